//! Properties that depend on all projectors of a configuration: blends computed from their overlap, and matched brightness.

use std::sync::Arc;

use super::{
    Config, ConfigError, VIEWS,
    memo::Memo,
    projector::{BlendConfig, FOLDS, ProjectorConfig},
    views::{ViewKindSpec, ViewSpec},
};
use crate::{
    ranges::KeyError,
    theatre::ScreenSums,
    view::{
        View, ViewKind,
        projector::{Beam, Blend, ProjectorOutput, edge_blends},
    },
};

/// Gives the projectors among `views` their computed blends and matches their brightness. Returns the factor on the light of each view. An error has
/// the index of its view.
pub(super) fn match_projectors(
    configs: &[ViewSpec],
    views: &mut [View],
    computed: &Memo<Vec<Beam>, Vec<Blend>>,
) -> Result<Vec<f64>, (usize, KeyError)> {
    let mut factors = vec![1.0; views.len()];
    let projectors: Vec<(usize, &ProjectorConfig)> = configs
        .iter()
        .enumerate()
        .filter_map(|(index, view)| match &view.geometry.kind {
            ViewKindSpec::Projector(projector) => Some((index, &**projector)),
            _ => None,
        })
        .collect();
    let computes = |projector: &ProjectorConfig| projector.blend == BlendConfig::Computed;
    let blends = if projectors.iter().any(|(_, projector)| computes(projector)) {
        if let Some((index, _)) = projectors.iter().find(|(_, projector)| !computes(projector)) {
            let problem =
                "other projectors have computed blends: either all projectors of a configuration have them, or none";
            return Err((*index, KeyError::new("blend", problem)));
        }
        let beams = projectors.iter().filter_map(|(index, projector)| {
            let (mapping, dome_from_view) = views[*index].raster()?;
            let black = match (projector.black_cd_m2, projector.white_cd_m2) {
                (Some(black), Some(white)) => black / white,
                _ => 0.0,
            };
            Some(Beam { mapping: Arc::clone(mapping), dome_from_view, black })
        });
        let beams: Vec<Beam> = beams.collect();
        let blends = computed.of(&beams, || Ok::<_, (usize, KeyError)>(edge_blends(&beams)))?;
        blends.into_iter().map(Some).collect()
    } else {
        vec![None; projectors.len()]
    };
    let whites: Vec<f64> = projectors.iter().filter_map(|(_, projector)| projector.white_cd_m2).collect();
    if let Some((index, _)) =
        projectors.iter().find(|(_, projector)| projector.white_cd_m2.is_none() && !whites.is_empty())
    {
        let problem =
            "missing key: other projectors have it, and brightness is matched among all projectors of a configuration";
        return Err((*index, KeyError::new("white_cd_m2", problem)));
    }
    let darkest_cd_m2 = whites.iter().copied().fold(f64::INFINITY, f64::min);
    for ((index, projector), computed) in projectors.into_iter().zip(blends) {
        let ViewKind::Projector { output, .. } = &mut views[index].kind else { continue };
        let share = projector.white_cd_m2.map_or(1.0, |white_cd_m2| darkest_cd_m2 / white_cd_m2);
        factors[index] = share;
        if computed.is_none() && share == 1.0 {
            continue;
        }
        let blend = computed.or_else(|| output.blend().cloned());
        let blend = match blend {
            Some(blend) if share < 1.0 => blend.dimmed(share),
            Some(blend) => blend,
            None => Blend::uniform(output.size(), share),
        };
        let changed = ProjectorOutput::with_blend(output, Some(blend));
        *output = Arc::new(changed.map_err(|problem| (index, KeyError::new("blend", problem)))?);
    }
    Ok(factors)
}

/// A projector, with the properties that the rules of domes check.
#[derive(Clone, Debug)]
pub struct DomeProjector {
    /// Its view.
    pub view: View,
    /// The points of its part of the screen in view axes, if the calibration has them.
    pub screen: Option<ScreenSums>,
    /// Factor on its light that reduces its white to that of the darkest projector.
    pub dimmed_to: f64,
}

/// A projector that cannot be a view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DomeFault {
    /// Name of the view.
    pub name: String,
    /// Description of the fault.
    pub problem: String,
    /// Whether its warp folds or has no inverse.
    pub folds: bool,
}

impl Config {
    /// All projectors, and the faults of those that cannot be views.
    ///
    /// # Errors
    ///
    /// A key that must agree among all projectors differs.
    pub fn dome_projectors(&self) -> Result<(Vec<DomeProjector>, Vec<DomeFault>), ConfigError> {
        let (mut configs, mut views, mut screens, mut faults) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for config in &self.views {
            let ViewKindSpec::Projector(projector) = &config.geometry.kind else { continue };
            match config.view(Some(&self.folder)) {
                Ok(view) => {
                    configs.push(config.clone());
                    views.push(view);
                    screens.push(projector.screen(&self.folder));
                }
                Err(KeyError { key, problem }) => {
                    let folds = problem.contains(FOLDS);
                    faults.push(DomeFault { name: config.name.clone(), problem: format!("{key}: {problem}"), folds });
                }
            }
        }
        let factors = match_projectors(&configs, &mut views, &self.computed_blends)
            .map_err(|(index, fault)| self.error(VIEWS.fault(index, Some(&configs[index].name), fault)))?;
        let projectors = views.into_iter().zip(screens).zip(factors);
        Ok((projectors.map(|((view, screen), dimmed_to)| DomeProjector { view, screen, dimmed_to }).collect(), faults))
    }
}
