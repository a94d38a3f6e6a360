//! The tables of tabulated projections on the adapter: a few buffers with those of a rig, bound by every pass that projects.
//!
//! Shaders know tables only if they are made so (`shaders/shared/tabulated.wgsl` in place of `tabulated_off.wgsl`), and those of
//! rigs without tabulated pictures are not: a renderer has a set of pipelines for each kind of rig.

use std::sync::Arc;

use super::shader::Shader;
use crate::{
    gpu::{Gpu, storage_buffer},
    plan::tables::{TABLE_BUFFERS, spread},
    view::{
        Viewport,
        projection::{Projection, TabulatedMapping},
    },
};

/// What a shader imports in place of tabulated projections where there are none, and where there are some.
const FILES: [&str; 2] = ["shared/tabulated_off", "shared/tabulated"];
/// How files call the choice between them.
pub(super) const SLOT: &str = "tabulated";

/// The file for shaders with tabulated projections or without.
pub(super) fn file(with_tables: bool) -> &'static str {
    FILES[usize::from(with_tables)]
}

/// The shader of a file that projects, for what the device holds.
pub(crate) fn projecting(gpu: &Gpu, file: &str) -> Shader {
    Shader::new(file).with(SLOT, self::file(gpu.has_tables()))
}

fn table_of(viewport: &Viewport) -> Option<&Arc<TabulatedMapping>> {
    match &viewport.projection {
        Projection::Tabulated(table) => Some(table),
        _ => None,
    }
}

/// The number of a buffer stands above these bits of the number of a group of words in it.
pub(super) const GROUP_BITS: u32 = u32::BITS - TABLE_BUFFERS.trailing_zeros();

/// Which tables the device holds, each with its buffer and the number of its first group of words there.
#[derive(Default)]
pub(crate) struct MappingTables {
    held: Vec<(Arc<TabulatedMapping>, u32)>,
    buffers: Option<[wgpu::Buffer; TABLE_BUFFERS]>,
}

impl MappingTables {
    /// Has passes read the tables of these viewports, which go onto the device unless they are there; without any, passes read none.
    pub(crate) fn hold(&mut self, gpu: &mut Gpu, viewports: &[Viewport]) {
        let mut wanted: Vec<&Arc<TabulatedMapping>> = Vec::new();
        for table in viewports.iter().filter_map(table_of) {
            if !wanted.contains(&table) {
                wanted.push(table);
            }
        }
        if wanted.is_empty() {
            gpu.set_tables(None);
            return;
        }
        if wanted.iter().any(|table| self.first_of(table).is_none()) {
            self.release();
            let (buffers, _) = spread(wanted.iter().map(|table| table.bytes()));
            let mut words: [Vec<[u32; 4]>; TABLE_BUFFERS] = Default::default();
            for (table, buffer) in wanted.into_iter().zip(buffers) {
                self.held.push((Arc::clone(table), (buffer as u32) << GROUP_BITS | words[buffer].len() as u32));
                words[buffer].extend(table.words());
            }
            // A buffer that is bound has something.
            words.iter_mut().filter(|words| words.is_empty()).for_each(|words| words.push([0; 4]));
            self.buffers = Some(words.map(|words| storage_buffer(gpu, "mapping tables", &words)));
        }
        gpu.set_tables(self.buffers.clone());
    }

    /// Whether any of these viewports is tabulated.
    pub(crate) fn are_needed(viewports: &[Viewport]) -> bool {
        viewports.iter().any(|viewport| table_of(viewport).is_some())
    }

    /// Lets go of all tables.
    pub(crate) fn release(&mut self) {
        self.held.clear();
        self.buffers = None;
    }

    fn first_of(&self, table: &Arc<TabulatedMapping>) -> Option<u32> {
        self.held.iter().find(|(held, _)| held == table).map(|(_, first)| *first)
    }

    /// The buffer and the first group of words of a viewport's table; `None` if it is not tabulated.
    pub(crate) fn first_group(&self, viewport: &Viewport) -> Option<u32> {
        self.first_of(table_of(viewport)?)
    }
}
