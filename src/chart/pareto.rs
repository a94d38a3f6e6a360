//! The Pareto front: the points that no other point beats in both figures.

/// A point that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("point {index} ({x}, {y}): both figures must be finite")]
pub struct ParetoError {
    /// Index of the first such point.
    pub index: usize,
    /// First figure of the point.
    pub x: f64,
    /// Second figure of the point.
    pub y: f64,
}

/// Returns the indices of the points (time, error) that no other point dominates, in order of increasing time; smaller
/// is better in both. A point dominates another if it is not worse in either figure and better in one. Equal points are
/// all on the front.
///
/// # Errors
/// [`ParetoError`] for the first point with a figure that is not finite, which cannot be compared.
pub fn pareto_front(points: &[(f64, f64)]) -> Result<Vec<usize>, ParetoError> {
    if let Some((index, &(x, y))) = points.iter().enumerate().find(|(_, p)| !(p.0.is_finite() && p.1.is_finite())) {
        return Err(ParetoError { index, x, y });
    }
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].0.total_cmp(&points[b].0).then(points[a].1.total_cmp(&points[b].1)));
    let mut front: Vec<usize> = Vec::new();
    for index in order {
        // The points are sorted by time, so no point of the front so far is slower. The next point belongs to the front only if its error is smaller
        // than that of the front's last point.
        let stays = front.last().is_none_or(|&last| points[index].1 < points[last].1 || points[index] == points[last]);
        if stays {
            front.push(index);
        }
    }
    Ok(front)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates the definition of the front directly.
    fn by_definition(points: &[(f64, f64)]) -> Vec<usize> {
        let dominates = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
        (0..points.len()).filter(|&i| !points.iter().any(|&other| dominates(other, points[i]))).collect()
    }

    #[test]
    fn front_matches_the_definition() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Few distinct values, so that ties and equal points occur.
            ((state >> 60) as f64) / 4.0
        };
        for count in 0..200 {
            let points: Vec<(f64, f64)> = (0..count % 23).map(|_| (random(), random())).collect();
            let mut front = pareto_front(&points).unwrap();
            assert!(front.is_sorted_by(|&a, &b| points[a].0 <= points[b].0));
            front.sort_unstable();
            assert_eq!(front, by_definition(&points), "{points:?}");
        }
    }

    #[test]
    fn dominated_point_is_not_on_the_front() {
        assert_eq!(pareto_front(&[(1.0, 1.0), (2.0, 0.5), (2.0, 0.6), (3.0, 0.5), (0.5, 9.0)]), Ok(vec![4, 0, 1]));
        assert_eq!(pareto_front(&[(1.0, 0.0), (1.0, 0.0)]), Ok(vec![0, 1]));
    }

    #[test]
    fn non_finite_points_are_refused() {
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(pareto_front(&[(1.0, 1.0), (2.0, wrong)]).unwrap_err().index, 1);
            assert_eq!(pareto_front(&[(wrong, 1.0)]).unwrap_err().index, 0);
        }
    }
}
