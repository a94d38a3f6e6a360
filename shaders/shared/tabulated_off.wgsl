// In place of shared/tabulated: no picture is tabulated.
