//! Polynomials of one variable.

/// Evaluates a polynomial at `x`; coefficients begin with the constant one.
pub(crate) fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_in_order_of_increasing_powers() {
        assert_eq!(polynomial(&[1.0, 2.0, 3.0], 2.0), 17.0);
        assert_eq!(polynomial(&[], 2.0), 0.0);
    }
}
