//! Tables of tabulated projections on the adapter: the tables of a rig are in one buffer or one texture
//! ([`crate::plan::tables`]), bound by every pass that projects.
//!
//! A shader supports tables only if it is built with `shaders/shared/tabulated.wgsl` instead of `tabulated_off.wgsl`. Rigs without tabulated pictures
//! use shaders without tables, so a renderer has one set of pipelines for each kind of rig.

use std::sync::Arc;

use super::shader::Shader;
use crate::{
    gpu::{Gpu, Tables},
    plan::tables::{TableForm, table_form},
    view::{
        Viewport,
        projection::{Projection, TabulatedMapping},
    },
};

/// Import slot for tabulated projections, and its files: without and with tables.
pub(super) const SLOT: &str = "tabulated";
const FILES: [&str; 2] = ["shared/tabulated_off", "shared/tabulated"];
/// Import slot for the form of the tables.
const FORM_SLOT: &str = "tables";

/// Chooses the files for a shader that reads tables of this form.
pub(super) fn with_tables(shader: Shader, form: TableForm) -> Shader {
    let shader = shader.with(SLOT, FILES[usize::from(form != TableForm::None)]);
    match form {
        TableForm::None => shader,
        TableForm::Buffer => shader.with(FORM_SLOT, "shared/tables_buffer"),
        TableForm::Texture => shader.with(FORM_SLOT, "shared/tables_texture"),
    }
}

/// Returns a shader that projects, built for the current tables of the device.
pub(crate) fn projecting(gpu: &Gpu, file: &str) -> Shader {
    with_tables(Shader::new(file), gpu.table_form())
}

fn table_of(viewport: &Viewport) -> Option<&Arc<TabulatedMapping>> {
    match &viewport.projection {
        Projection::Tabulated(table) => Some(table),
        _ => None,
    }
}

/// Returns the distinct tables of the viewports.
fn tables_of(viewports: &[Viewport]) -> Vec<&Arc<TabulatedMapping>> {
    let mut tables: Vec<&Arc<TabulatedMapping>> = Vec::new();
    for table in viewports.iter().filter_map(table_of) {
        if !tables.contains(&table) {
            tables.push(table);
        }
    }
    tables
}

/// Returns the form of tables on this adapter.
pub(super) fn form_of(gpu: &Gpu, tables: &[&Arc<TabulatedMapping>]) -> TableForm {
    table_form(tables.iter().map(|table| table.bytes()).sum(), gpu.table_buffer_bytes())
}

/// Tables on the device, each with the index of its first group of words.
#[derive(Default)]
pub(crate) struct MappingTables {
    held: Vec<(Arc<TabulatedMapping>, u32)>,
    tables: Tables,
}

impl MappingTables {
    /// Sets the tables of these viewports for the passes, and uploads them if necessary. If there are none, passes read no tables.
    pub(crate) fn hold(&mut self, gpu: &mut Gpu, viewports: &[Viewport]) {
        let wanted = tables_of(viewports);
        if wanted.is_empty() {
            gpu.set_tables(Tables::None);
            return;
        }
        if wanted.iter().any(|table| self.first_of(table).is_none()) {
            self.release();
            let form = form_of(gpu, &wanted);
            let mut groups: Vec<[u32; 4]> = Vec::new();
            for table in wanted {
                self.held.push((Arc::clone(table), groups.len() as u32));
                groups.extend(table.words());
            }
            self.tables = Tables::new(gpu, form, &groups);
        }
        gpu.set_tables(self.tables.clone());
    }

    /// Returns the form of the tables of these viewports.
    pub(crate) fn needed(&self, gpu: &Gpu, viewports: &[Viewport]) -> TableForm {
        let wanted = tables_of(viewports);
        // Tables already on the device keep their form.
        match wanted.iter().all(|table| self.first_of(table).is_some()) {
            _ if wanted.is_empty() => TableForm::None,
            true => self.tables.form(),
            false => form_of(gpu, &wanted),
        }
    }

    /// Releases all tables.
    pub(crate) fn release(&mut self) {
        self.held.clear();
        self.tables = Tables::None;
    }

    fn first_of(&self, table: &Arc<TabulatedMapping>) -> Option<u32> {
        self.held.iter().find(|(held, _)| held == table).map(|(_, first)| *first)
    }

    /// Returns the index of the first group of words of a viewport's table; `None` if the viewport is not tabulated.
    pub(crate) fn first_group(&self, viewport: &Viewport) -> Option<u32> {
        self.first_of(table_of(viewport)?)
    }
}
