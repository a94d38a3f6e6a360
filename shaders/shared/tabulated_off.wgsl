// Replaces shared/tabulated if no picture is tabulated.
