//! Tables of tabulated projections on the adapter: the tables of a rig are in one or two buffers ([`TableBuffers`]),
//! bound by every pass that projects.
//!
//! A shader supports tables only if it is built with them (`shaders/shared/tabulated.wgsl` instead of
//! `tabulated_off.wgsl`). Rigs without tabulated pictures use shaders without tables, so a renderer has one set of
//! pipelines for each kind of rig.

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

/// Import slot for tabulated projections, and its files: without and with tables.
pub(super) const SLOT: &str = "tabulated";
const FILES: [&str; 2] = ["shared/tabulated_off", "shared/tabulated"];
/// Import slot for the number of table buffers, and its files: one and two buffers.
const BUFFERS_SLOT: &str = "tables";
const BUFFERS_FILES: [&str; 2] = ["shared/tables_one", "shared/tables_two"];

/// Chooses the files for a shader that reads tables from `buffers` buffers (0: no tables).
pub(super) fn with_tables(shader: Shader, buffers: usize) -> Shader {
    let shader = shader.with(SLOT, FILES[usize::from(buffers > 0)]);
    if buffers > 0 { shader.with(BUFFERS_SLOT, BUFFERS_FILES[usize::from(buffers > 1)]) } else { shader }
}

/// A shader that projects, built for the current tables of the device.
pub(crate) fn projecting(gpu: &Gpu, file: &str) -> Shader {
    with_tables(Shader::new(file), gpu.table_buffers())
}

fn table_of(viewport: &Viewport) -> Option<&Arc<TabulatedMapping>> {
    match &viewport.projection {
        Projection::Tabulated(table) => Some(table),
        _ => None,
    }
}

/// Distinct tables of the viewports.
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

/// Bit in the index of a group of words: the group is in the second buffer.
pub(super) const SECOND_BUFFER: u32 = 1 << 31;

/// Tables on the device, each with its buffer and the index of its first group of words there.
#[derive(Default)]
pub(crate) struct MappingTables {
    held: Vec<(Arc<TabulatedMapping>, u32)>,
    buffers: Vec<wgpu::Buffer>,
}

impl MappingTables {
    /// Sets the tables of these viewports for the passes, and uploads them if necessary. Without tables, passes read
    /// none.
    pub(crate) fn hold(&mut self, gpu: &mut Gpu, viewports: &[Viewport]) {
        let wanted = tables_of(viewports);
        if wanted.is_empty() {
            gpu.set_tables(Vec::new());
            return;
        }
        if wanted.iter().any(|table| self.first_of(table).is_none()) {
            self.release();
            let TableBuffers { buffers: buffer_of_table, bytes } = buffers_of(gpu, &wanted);
            let mut words: Vec<Vec<[u32; 4]>> = vec![Vec::new(); bytes.len()];
            for (table, buffer) in wanted.into_iter().zip(buffer_of_table) {
                let buffer_bit = if buffer > 0 { SECOND_BUFFER } else { 0 };
                self.held.push((Arc::clone(table), buffer_bit | words[buffer].len() as u32));
                words[buffer].extend(table.words());
            }
            // A bound buffer must not be empty.
            words.iter_mut().filter(|words| words.is_empty()).for_each(|words| words.push([0; 4]));
            self.buffers = words.iter().map(|words| storage_buffer(gpu, "mapping tables", words)).collect();
        }
        gpu.set_tables(self.buffers.clone());
    }

    /// Number of buffers for the tables of these viewports; 0 if none is tabulated.
    pub(crate) fn needed(&self, gpu: &Gpu, viewports: &[Viewport]) -> usize {
        let wanted = tables_of(viewports);
        // Tables already on the device keep their distribution.
        match wanted.iter().all(|table| self.first_of(table).is_some()) {
            _ if wanted.is_empty() => 0,
            true => self.buffers.len(),
            false => buffers_of(gpu, &wanted).bytes.len(),
        }
    }

    /// Releases all tables.
    pub(crate) fn release(&mut self) {
        self.held.clear();
        self.buffers.clear();
    }

    fn first_of(&self, table: &Arc<TabulatedMapping>) -> Option<u32> {
        self.held.iter().find(|(held, _)| held == table).map(|(_, first)| *first)
    }

    /// Buffer bit and index of the first group of words of a viewport's table; `None` if the viewport is not tabulated.
    pub(crate) fn first_group(&self, viewport: &Viewport) -> Option<u32> {
        self.first_of(table_of(viewport)?)
    }
}
