// The lists of asteroids that culling writes and the drawing passes read.

#import structs/AsteroidCullParameters
#import structs/AsteroidEntry
#import structs/AsteroidPlane
