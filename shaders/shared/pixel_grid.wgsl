// Pixels of one workgroup of the passes over pixels; the same numbers stand in src/passes/shared.rs.

const COLUMNS: u32 = 64u;
const ROWS: u32 = 16u;
