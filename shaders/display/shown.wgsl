// The display image, written by the pass over pixels itself.

@group(0) @binding(6) var<storage, read_write> display: array<u32>;

fn show(index: u32, word: u32) {
    display[index] = word;
}
