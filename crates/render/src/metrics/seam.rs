//! Seams: how the light of a star varies while it moves over an edge between images, over the date line or over a pole.

use super::{
    HdrView,
    error::{MetricError, not_negative},
    flux::total_illuminance_lx,
};

/// Returns the largest value divided by the smallest, minus 1: 0 for a constant. Infinite if the smallest is 0 and the largest is not.
///
/// # Errors
/// [`MetricError::TooFew`] below two values, [`MetricError::NotPositive`] for one that is negative or not finite,
/// [`MetricError::NoLight`] if all are 0.
pub fn relative_variation(values: &[f64]) -> Result<f64, MetricError> {
    if values.len() < 2 {
        return Err(MetricError::TooFew { what: "values of a sweep", found: values.len(), least: 2 });
    }
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for value in values {
        let value = not_negative("value of a sweep", *value)?;
        (least, most) = (least.min(value), most.max(value));
    }
    if most > 0.0 { Ok(most / least - 1.0) } else { Err(MetricError::NoLight("a sweep")) }
}

/// Returns the variation of the total light over a sweep. Each step of the sweep is the set of all images of one view.
///
/// # Errors
/// Same as [`relative_variation`], and [`MetricError::OutsidePicture`] if a pixel outside of the picture has light.
pub fn seam_error<'a>(steps: impl IntoIterator<Item = &'a [HdrView<'a>]>) -> Result<f64, MetricError> {
    let light_lx = steps.into_iter().map(total_illuminance_lx).collect::<Result<Vec<_>, _>>()?;
    relative_variation(&light_lx)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        metrics::synthetic::Canvas,
        photometry::kernel::SplatKernel,
        view::projection::{CubeFace, Face, PlaneMapping},
    };

    /// Draws images of a star on the given faces, for the steps of a sweep from the front face, over the middle of its edge, to the right face.
    fn sweep(mappings: &[&dyn PlaneMapping], faces: &[Face]) -> Vec<Vec<Vec<[f64; 3]>>> {
        let step = |i: i32| {
            let direction = DVec3::new(1.0, 0.1, -1.0 + 0.01 * f64::from(i));
            let draw = |(mapping, face): (&&dyn PlaneMapping, &Face)| {
                let seen = face.cube_from_face().conjugate() * direction;
                Canvas::new(*mapping).star(seen, 1e-6, &|centre| SplatKernel::Tent.footprint(centre)).pixels
            };
            mappings.iter().zip(faces).map(draw).collect()
        };
        (-20..=20).map(step).collect()
    }

    fn variation(mappings: &[&dyn PlaneMapping], images: &[Vec<Vec<[f64; 3]>>]) -> Result<f64, MetricError> {
        let view = |(mapping, pixels): (&&'_ dyn PlaneMapping, &Vec<[f64; 3]>)| {
            total_illuminance_lx(&[HdrView::new(*mapping, pixels).unwrap()]).unwrap()
        };
        let light: Vec<f64> = images.iter().map(|step| mappings.iter().zip(step).map(view).sum()).collect();
        relative_variation(&light)
    }

    #[test]
    fn a_lost_half_at_an_edge_is_found() {
        let faces = [Face::Front, Face::Right];
        let [front, right] = faces.map(|face| CubeFace::new(face, 64).unwrap());
        let mappings: [&dyn PlaneMapping; 2] = [&front, &right];
        let images = sweep(&mappings, &faces);
        assert!(variation(&mappings, &images).unwrap() < 1e-9);
        // Without its neighbour, the front face shows the whole star, then half of it, then nothing. If half is lost, the largest value is twice the
        // smallest; if all is lost, the variation is infinite.
        assert_eq!(variation(&mappings[..1], &images), Ok(f64::INFINITY));
        let to_the_edge = variation(&mappings[..1], &images[..=20]).unwrap();
        assert!((to_the_edge - 1.0).abs() < 1e-9, "{to_the_edge}");
    }

    #[test]
    fn images_and_numbers_give_the_same_variation() {
        let face = CubeFace::new(Face::Up, 16).unwrap();
        let pixels = [1.0, 1.02, 0.99].map(|level| vec![[level; 3]; 256]);
        let views = pixels.each_ref().map(|pixels| [HdrView::new(&face, pixels).unwrap()]);
        let found = seam_error(views.iter().map(|step| &step[..])).unwrap();
        assert!((found - (1.02 / 0.99 - 1.0)).abs() < 1e-12, "{found}");
        assert_eq!(relative_variation(&[2.0, 3.0, 2.5]), Ok(0.5));
        assert!(relative_variation(&[1.0]).is_err() && relative_variation(&[0.0, 0.0]).is_err());
        assert!(relative_variation(&[1.0, f64::NAN]).is_err() && relative_variation(&[1.0, -1.0]).is_err());
    }
}
