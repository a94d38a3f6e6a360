//! Lines and text of overlays in each image, in pixels: f64 and plain data.
//!
//! Every line is a circle, or an arc of one, on the sphere of directions around an eye: grids and test patterns are defined that way, and a
//! straight line in space lies in one plane with the eye. [`arc`] contains these arcs, [`trace`] projects them and cuts them into straight
//! pieces within a twentieth of a pixel of the curve. Text becomes one bitmap per glyph ([`text`]). The resulting items are sorted into blocks
//! of pixels ([`blocks`]).
//!
//! Items are drawn in order. The items of a stroke count as one shape: where they overlap, the largest coverage counts, so that translucent lines
//! show no beads at their joints.

pub mod arc;
pub mod blocks;
mod grid;
mod labels;
mod pattern;
pub mod pictures;
mod technique;
pub mod text;
pub mod trace;

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};

use self::{
    blocks::{Block, sort_into_blocks},
    text::GlyphCache,
    trace::Tracer,
};
use crate::{
    coordinates::direction_from_lon_lat,
    observer::{Frame, Refraction},
    relativity::Motion,
    scene::{
        Camera, SceneObjects,
        bodies::Body,
        overlay::{Colour, LineStyle, Overlay},
        surroundings::{BEYOND_AIR_M, Surroundings},
    },
    view::Viewport,
};

/// Maximum number of items of a frame: 64 bytes each on the adapter.
pub const MOST_ITEMS: usize = 1 << 20;

/// Upper bound of the displacement of the ends of a line by dense air.
const MOST_BENT_RAD: f64 = 0.04;

/// Nearness of items that no surface hides.
pub const BEFORE_ALL: f64 = f64::INFINITY;
/// Nearness of items at infinity.
pub const AT_INFINITY: f64 = 0.0;

/// Error of an overlay that cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OverlayPlanError {
    /// There are too many lines in too many images.
    #[error(
        "the overlay has more than {MOST_ITEMS} pieces of lines and text in all images: use wider spacings of grids, fewer views or shorter trajectories"
    )]
    TooMany,
}

/// Colour and opacity of a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// Codes of the display.
    pub colour: Colour,
    /// 0 to 1.
    pub opacity: f64,
}

/// Area that an item covers, in continuous pixel coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A straight line with round ends. The coverage of a pixel whose centre is at distance `d` is `half_width_px + 0.5 - d`, from 0 to 1.
    Line {
        /// One end.
        from: DVec2,
        /// The other end.
        to: DVec2,
        /// Half its width.
        half_width_px: f64,
        /// Inverse distance of both ends, 1/m; linear along the line.
        nearness: [f64; 2],
    },
    /// Whole pixels, or every second one in a checkerboard.
    Box {
        /// First column and row.
        from: [i32; 2],
        /// One past the last column and row.
        to: [i32; 2],
        /// Whether to fill only pixels whose column and row have an even sum.
        checkered: bool,
    },
    /// A bitmap of coverage.
    Glyph {
        /// First column and row.
        from: [i32; 2],
        /// Columns and rows.
        size: [u32; 2],
        /// Coverage of the first pixel: index into [`OverlayPlan::texels`]; the others follow row by row.
        first_texel: u32,
        /// Inverse distance, 1/m.
        nearness: f64,
    },
    /// Pixels that a part of a picture may cover.
    Picture {
        /// First column and row.
        from: [i32; 2],
        /// One past the last column and row.
        to: [i32; 2],
        /// Position of its header ([`pictures::HEADER_WORDS`]) in [`OverlayPlan::texels`], 32-bit words.
        header: u32,
        /// Inverse distance, 1/m.
        nearness: f64,
    },
}

/// An item.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// Number of the stroke, whose items count as one shape.
    pub stroke: u32,
    /// Colour and opacity of the stroke.
    pub ink: Ink,
    /// Covered area.
    pub shape: Shape,
}

/// Overlay of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OverlayPlan {
    /// All items, viewport by viewport, in the order in which they are drawn.
    pub items: Vec<Item>,
    /// First item of each viewport, and finally the number of items.
    pub first_items: Vec<usize>,
    /// Coverage of the pixels of glyphs, 0 to 255, and headers and texels of pictures.
    pub texels: Vec<u8>,
    /// Blocks of pixels with items, viewport by viewport.
    pub blocks: Vec<Block>,
    /// Items of the blocks.
    pub entries: Vec<u32>,
}

impl OverlayPlan {
    /// Whether there are no items.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Items of a viewport.
    pub fn items_of(&self, viewport: usize) -> &[Item] {
        &self.items[self.first_items[viewport]..self.first_items[viewport + 1]]
    }
}

/// Inputs of a plan.
#[derive(Clone, Copy, Debug)]
pub struct OverlayInputs<'a> {
    /// Scene with the overlay and the bodies that it labels.
    pub objects: &'a SceneObjects,
    /// The camera.
    pub camera: &'a Camera,
    /// All viewports.
    pub viewports: &'a [Viewport],
    /// Names of the views.
    pub views: &'a [String],
}

/// Plans overlays. Keeps the last plan, for frames without motion, and glyph bitmaps; these do not change plans.
#[derive(Debug, Default)]
pub struct OverlayPlanner {
    glyphs: GlyphCache,
    last: Option<LastPlan>,
}

/// The last plan and its inputs.
#[derive(Debug)]
struct LastPlan {
    overlay: Arc<Overlay>,
    bodies: Vec<Arc<Body>>,
    camera: Camera,
    viewports: Vec<Viewport>,
    views: Vec<String>,
    /// Time of the scene, if the plan depends on it.
    horizon_s: Option<f64>,
    /// The ground, above which text is written.
    surroundings: Option<Arc<Surroundings>>,
    plan: Arc<OverlayPlan>,
}

/// Time of the objects, if some overlay parts turn with the Earth: parts in the axes of the horizon, or parts that air refracts.
fn horizon_s(objects: &SceneObjects) -> Option<f64> {
    let has_grid = objects.overlay.shows_horizon();
    let bends = objects.surroundings.as_ref().is_some_and(|around| around.refraction.is_some());
    (has_grid || bends).then_some(objects.time_s)
}

impl LastPlan {
    fn is_of(&self, inputs: &OverlayInputs<'_>) -> bool {
        let camera = Camera { revision: self.camera.revision, ..*inputs.camera };
        let bodies = &inputs.objects.bodies;
        let same_bodies =
            self.bodies.len() == bodies.len() && self.bodies.iter().zip(bodies).all(|(a, b)| Arc::ptr_eq(a, b));
        Arc::ptr_eq(&self.overlay, &inputs.objects.overlay)
            && same_bodies
            && self.camera == camera
            && self.viewports == inputs.viewports
            && self.views == inputs.views
            && self.horizon_s == horizon_s(inputs.objects)
            && self.surroundings == inputs.objects.surroundings
    }
}

impl OverlayPlanner {
    /// Plans a frame; `None`: no image has an overlay. A frame with the same inputs as the last one gets the same plan, without a copy.
    ///
    /// # Errors
    ///
    /// The frame would have too many items.
    pub fn plan(&mut self, inputs: &OverlayInputs<'_>) -> Result<Option<Arc<OverlayPlan>>, OverlayPlanError> {
        if inputs.objects.overlay.is_empty() {
            *self = Self::default();
            return Ok(None);
        }
        if let Some(last) = self.last.as_ref().filter(|last| last.is_of(inputs)) {
            return Ok(Some(Arc::clone(&last.plan)));
        }
        self.last = None;
        let plan = Arc::new(self.make(inputs)?);
        self.last = Some(LastPlan {
            overlay: Arc::clone(&inputs.objects.overlay),
            bodies: inputs.objects.bodies.clone(),
            camera: *inputs.camera,
            viewports: inputs.viewports.to_vec(),
            views: inputs.views.to_vec(),
            horizon_s: horizon_s(inputs.objects),
            surroundings: inputs.objects.surroundings.clone(),
            plan: Arc::clone(&plan),
        });
        Ok(Some(plan))
    }

    fn make(&mut self, inputs: &OverlayInputs<'_>) -> Result<OverlayPlan, OverlayPlanError> {
        let overlay = &inputs.objects.overlay;
        let mut drawing = Drawing { items: Vec::new(), stroke: 0, texels: Vec::new(), glyphs: &mut self.glyphs };
        drawing.glyphs.begin();
        let horizon = horizon_of(inputs.objects);
        let refraction = inputs.objects.refraction(inputs.camera.position_m);
        let mut first_texels = pictures::FirstTexels::new();
        let mut first_items = Vec::with_capacity(inputs.viewports.len() + 1);
        for viewport in inputs.viewports {
            first_items.push(drawing.items.len());
            let eye = Eye::new(inputs.camera, viewport, (horizon, refraction));
            for picture in &overlay.pictures {
                pictures::draw(&mut drawing, &mut first_texels, &eye, picture)?;
            }
            for grid in &overlay.grids {
                grid::draw(&mut drawing, &eye, grid)?;
            }
            for trajectory in &overlay.trajectories {
                let arcs = trajectory.points_m.windows(2).filter_map(|ends| eye.straight_line(ends[0], ends[1]));
                let is_far = |point: &DVec3| (*point - eye.position_m).length() > BEYOND_AIR_M;
                let bent = trajectory.points_m.iter().all(is_far);
                drawing.lines(&eye, &trajectory.style(), arcs, bent)?;
            }
            for grid in &overlay.grids {
                grid::draw_numbers(&mut drawing, &eye, grid, inputs.objects)?;
            }
            labels::draw_cardinal_points(&mut drawing, &eye, inputs.objects)?;
            labels::draw(&mut drawing, &eye, inputs.objects)?;
            let name = inputs.views.get(viewport.view);
            if let Some(name) = name.filter(|name| overlay.test_patterns.contains(name)) {
                pattern::draw(&mut drawing, &eye, name)?;
            }
        }
        first_items.push(drawing.items.len());
        let Drawing { items, texels, .. } = drawing;
        let (blocks, entries) = sort_into_blocks(&items, &first_items, inputs.viewports);
        Ok(OverlayPlan { items, first_items, texels, blocks, entries })
    }
}

/// An image and the eye that sees it.
struct Eye<'a> {
    viewport: &'a Viewport,
    view_from_world: DMat3,
    /// The camera's upward axis, in view axes.
    up: DVec3,
    camera: &'a Camera,
    /// Position, m.
    position_m: DVec3,
    motion: Option<Motion>,
    /// Refraction by air, in view axes.
    refraction: Option<Refraction>,
    /// North, east and zenith of the scene's observer.
    horizon: Option<DMat3>,
}

/// North, east and zenith of the observer, if a part of the overlay shows them.
fn horizon_of(objects: &SceneObjects) -> Option<DMat3> {
    if !objects.overlay.shows_horizon() {
        return None;
    }
    let icrs_from_horizon = objects.icrs_from(Frame::Horizon)?;
    Some(DMat3::from_cols(icrs_from_horizon.x_axis, -icrs_from_horizon.y_axis, icrs_from_horizon.z_axis))
}

/// Altitude below which the ground of the objects hides an azimuth, rad; at least 0.
fn ground_altitude_rad(objects: &SceneObjects, azimuth_rad: f64) -> f64 {
    let ground = objects.surroundings.as_ref().and_then(|around| around.ground.as_ref());
    ground.map_or(0.0, |ground| ground.horizon.altitude_rad(azimuth_rad)).max(0.0)
}

impl<'a> Eye<'a> {
    fn new(
        camera: &'a Camera,
        viewport: &'a Viewport,
        (horizon, refraction): (Option<DMat3>, Option<Refraction>),
    ) -> Self {
        let view_from_world = DMat3::from_quat(viewport.world_from_view.conjugate());
        Self {
            viewport,
            view_from_world,
            up: view_from_world * (camera.world_from_camera * DVec3::Y),
            camera,
            position_m: camera.position_m + viewport.eye_offset_m,
            motion: Motion::new(camera.velocity_c),
            refraction: refraction.map(|air| Refraction { zenith: view_from_world * air.zenith, ..air }),
            horizon,
        }
    }

    /// Apparent direction of a distant object, in view axes. `direction` is in world axes. Both may have any length but 0.
    fn apparent(&self, direction: DVec3) -> DVec3 {
        let seen = self.apparent_without_air(direction);
        self.refraction.map_or(seen, |refraction| refraction.seen(seen))
    }

    /// The same direction, without refraction.
    fn apparent_without_air(&self, direction: DVec3) -> DVec3 {
        let seen = self.motion.map_or(direction, |motion| motion.seen(direction));
        self.view_from_world * seen
    }

    /// Apparent direction of an azimuth and an apparent altitude of the observer, rad, in view axes; `None` without an observer.
    fn towards_horizon(&self, [azimuth_rad, altitude_rad]: [f64; 2]) -> Option<DVec3> {
        let direction = direction_from_lon_lat(azimuth_rad, altitude_rad);
        self.horizon.map(|axes| self.apparent_without_air(axes * direction))
    }

    /// A straight line between two points; `None` if the eye is on the line, so that it is not visible.
    fn straight_line(&self, from_m: DVec3, to_m: DVec3) -> Option<arc::Arc> {
        arc::Arc::straight_line(from_m - self.position_m, to_m - self.position_m)
    }
}

/// Plan under construction.
struct Drawing<'a> {
    items: Vec<Item>,
    stroke: u32,
    texels: Vec<u8>,
    glyphs: &'a mut GlyphCache,
}

impl Drawing<'_> {
    /// Pads the texels to whole 32-bit words.
    fn align_texels(&mut self) {
        self.texels.resize(self.texels.len().next_multiple_of(4), 0);
    }

    /// Begins a new stroke.
    fn next_stroke(&mut self) {
        self.stroke += 1;
    }

    fn push(&mut self, ink: Ink, shape: Shape) -> Result<(), OverlayPlanError> {
        if self.items.len() >= MOST_ITEMS {
            return Err(OverlayPlanError::TooMany);
        }
        self.items.push(Item { stroke: self.stroke, ink, shape });
        Ok(())
    }

    /// Draws lines in world axes, as one stroke. `bent`: whether air refracts them if there is any.
    fn lines(
        &mut self,
        eye: &Eye<'_>,
        style: &LineStyle,
        arcs: impl Iterator<Item = arc::Arc>,
        bent: bool,
    ) -> Result<(), OverlayPlanError> {
        if let Some(motion) = eye.motion {
            // Aberration maps circles to circles, but not uniformly, so the complete mapping is traced.
            let map = |direction: DVec3| eye.view_from_world * motion.seen(direction);
            return self.traced(eye, style, arcs, &map, None);
        }
        let turned = arcs.map(|arc| arc.turned(&eye.view_from_world));
        if let Some(refraction) = eye.refraction.filter(|_| bent) {
            return self.traced(eye, style, turned, &|direction| refraction.seen(direction), Some(MOST_BENT_RAD));
        }
        self.traced(eye, style, turned, &|direction| direction, Some(0.0))
    }

    /// Draws lines in view axes, as one stroke.
    fn view_lines(
        &mut self,
        eye: &Eye<'_>,
        style: &LineStyle,
        arcs: impl Iterator<Item = arc::Arc>,
    ) -> Result<(), OverlayPlanError> {
        self.traced(eye, style, arcs, &|direction| direction, Some(0.0))
    }

    fn traced(
        &mut self,
        eye: &Eye<'_>,
        style: &LineStyle,
        arcs: impl Iterator<Item = arc::Arc>,
        map: &dyn Fn(DVec3) -> DVec3,
        bends_rad: Option<f64>,
    ) -> Result<(), OverlayPlanError> {
        self.next_stroke();
        let half_width_px = style.width_px / 2.0;
        let ink = Ink { colour: style.colour, opacity: style.opacity };
        let mut tracer = Tracer::new(&eye.viewport.projection, half_width_px + 1.0, map, bends_rad);
        for arc in arcs {
            for piece in tracer.trace(&arc) {
                let [from, to] = piece.ends;
                self.push(ink, Shape::Line { from, to, half_width_px, nearness: piece.nearness })?;
            }
        }
        Ok(())
    }
}
