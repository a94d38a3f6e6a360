// The lists of asteroids that culling makes and the drawing passes read.

#import structs/AsteroidCullParameters
#import structs/AsteroidEntry
#import structs/AsteroidPlane
