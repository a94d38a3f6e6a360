//! The tables of tabulated projections on the adapter: one buffer with those of a rig, or two ([`TableBuffers`]), bound by every pass that projects.
//!
//! Shaders know tables only if they are made so (`shaders/shared/tabulated.wgsl` in place of `tabulated_off.wgsl`), and those of
//! rigs without tabulated pictures are not: a renderer has a set of pipelines for each kind of rig.

use std::sync::Arc;

use super::shader::Shader;
use crate::{
    gpu::{Gpu, storage_buffer},
    plan::tables::TableBuffers,
    view::{
        Viewport,
        projection::{Projection, TabulatedMapping},
    },
};

/// How files call the choice between tabulated projections and none, and what they import.
pub(super) const SLOT: &str = "tabulated";
const FILES: [&str; 2] = ["shared/tabulated_off", "shared/tabulated"];
/// The same of one buffer and two.
const BUFFERS_SLOT: &str = "tables";
const BUFFERS_FILES: [&str; 2] = ["shared/tables_one", "shared/tables_two"];

/// A shader that reads tables in so many buffers, or none.
pub(super) fn with_tables(shader: Shader, buffers: usize) -> Shader {
    let shader = shader.with(SLOT, FILES[usize::from(buffers > 0)]);
    if buffers > 0 { shader.with(BUFFERS_SLOT, BUFFERS_FILES[usize::from(buffers > 1)]) } else { shader }
}

/// The shader of a file that projects, for what the device holds.
pub(crate) fn projecting(gpu: &Gpu, file: &str) -> Shader {
    with_tables(Shader::new(file), gpu.table_buffers())
}

fn table_of(viewport: &Viewport) -> Option<&Arc<TabulatedMapping>> {
    match &viewport.projection {
        Projection::Tabulated(table) => Some(table),
        _ => None,
    }
}

/// The tables of viewports, each once.
fn tables_of(viewports: &[Viewport]) -> Vec<&Arc<TabulatedMapping>> {
    let mut tables: Vec<&Arc<TabulatedMapping>> = Vec::new();
    for table in viewports.iter().filter_map(table_of) {
        if !tables.contains(&table) {
            tables.push(table);
        }
    }
    tables
}

fn buffers_of(gpu: &Gpu, tables: &[&Arc<TabulatedMapping>]) -> TableBuffers {
    let bytes: Vec<u64> = tables.iter().map(|table| table.bytes()).collect();
    TableBuffers::new(&bytes, gpu.max_binding_bytes())
}

/// Set in the number of a group of words of the second buffer.
pub(super) const SECOND_BUFFER: u32 = 1 << 31;

/// Which tables the device holds, each with its buffer and the number of its first group of words there.
#[derive(Default)]
pub(crate) struct MappingTables {
    held: Vec<(Arc<TabulatedMapping>, u32)>,
    buffers: Vec<wgpu::Buffer>,
}

impl MappingTables {
    /// Has passes read the tables of these viewports, which go onto the device unless they are there; without any, passes read none.
    pub(crate) fn hold(&mut self, gpu: &mut Gpu, viewports: &[Viewport]) {
        let wanted = tables_of(viewports);
        if wanted.is_empty() {
            gpu.set_tables(Vec::new());
            return;
        }
        if wanted.iter().any(|table| self.first_of(table).is_none()) {
            self.release();
            let TableBuffers { of, bytes } = buffers_of(gpu, &wanted);
            let mut words: Vec<Vec<[u32; 4]>> = vec![Vec::new(); bytes.len()];
            for (table, buffer) in wanted.into_iter().zip(of) {
                let of_buffer = if buffer > 0 { SECOND_BUFFER } else { 0 };
                self.held.push((Arc::clone(table), of_buffer | words[buffer].len() as u32));
                words[buffer].extend(table.words());
            }
            // A buffer that is bound has something.
            words.iter_mut().filter(|words| words.is_empty()).for_each(|words| words.push([0; 4]));
            self.buffers = words.iter().map(|words| storage_buffer(gpu, "mapping tables", words)).collect();
        }
        gpu.set_tables(self.buffers.clone());
    }

    /// Buffers that the tables of these viewports take; 0 if none is tabulated.
    pub(crate) fn needed(&self, gpu: &Gpu, viewports: &[Viewport]) -> usize {
        let wanted = tables_of(viewports);
        // What is held stays where it is.
        match wanted.iter().all(|table| self.first_of(table).is_some()) {
            _ if wanted.is_empty() => 0,
            true => self.buffers.len(),
            false => buffers_of(gpu, &wanted).bytes.len(),
        }
    }

    /// Lets go of all tables.
    pub(crate) fn release(&mut self) {
        self.held.clear();
        self.buffers.clear();
    }

    fn first_of(&self, table: &Arc<TabulatedMapping>) -> Option<u32> {
        self.held.iter().find(|(held, _)| held == table).map(|(_, first)| *first)
    }

    /// The buffer and the first group of words of a viewport's table; `None` if it is not tabulated.
    pub(crate) fn first_group(&self, viewport: &Viewport) -> Option<u32> {
        self.first_of(table_of(viewport)?)
    }
}
