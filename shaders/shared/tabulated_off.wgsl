// Replaces shared/tabulated.wgsl if no picture is tabulated.
