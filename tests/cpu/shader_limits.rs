//! Every shader, in every combination of its choices, needs no more than the limits that every WebGPU adapter supports. The table of
//! `docs/adapters.md` is generated from this test: `STERADIAN_WRITE_REFERENCE=1` writes it, otherwise it must be equal.
#![allow(clippy::unwrap_used, reason = "a failed expectation of a test's own helpers is a failed test")]

use std::{collections::BTreeMap, fmt::Write, fs, path::Path};

use naga::{
    AddressSpace, ShaderStage, TypeInner,
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};
use steradian::render::shaders;

/// Limited resources of an adapter that an entry point uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Used {
    storage_buffers: u32,
    uniform_buffers: u32,
    textures: u32,
    /// Number of bind groups: the highest index plus one.
    groups: u32,
    /// Memory of a workgroup.
    workgroup_bytes: u32,
    /// Size of the largest uniform buffer.
    uniform_bytes: u32,
    /// Invocations of a workgroup. Pipelines that set this size use at most 64.
    invocations: u32,
}

/// The default limits of WebGPU (W3C WebGPU, section 3.6.2).
const WEBGPU: Used = Used {
    storage_buffers: 8,
    uniform_buffers: 12,
    textures: 16,
    groups: 4,
    workgroup_bytes: 16_384,
    uniform_bytes: 65_536,
    invocations: 256,
};

/// Choices for adapters with more storage buffers; each uses one additional buffer.
const WITH_MORE_BUFFERS: [&str; 3] = ["display/faint_map,", "display/shown,", "shared/tables_buffer"];

impl Used {
    fn fields(self) -> [u32; 7] {
        let Self { storage_buffers, uniform_buffers, textures, groups, workgroup_bytes, uniform_bytes, invocations } =
            self;
        [storage_buffers, uniform_buffers, textures, groups, workgroup_bytes, uniform_bytes, invocations]
    }

    /// Whether no value exceeds its limit in `limits`; `more` storage buffers are allowed in addition.
    fn is_within(self, limits: Self, more: u32) -> bool {
        let limits = Self { storage_buffers: limits.storage_buffers + more, ..limits };
        self.fields().iter().zip(limits.fields()).all(|(used, limit)| *used <= limit)
    }

    fn of(module: &naga::Module, info: &ModuleInfo) -> Self {
        let entry = &module.entry_points[0];
        let uses = info.get_entry_point(0);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let mut used = Self::default();
        for (_, variable) in module.global_variables.iter().filter(|(handle, _)| !uses[*handle].is_empty()) {
            let size = layouter[variable.ty].size;
            used.groups = used.groups.max(variable.binding.map_or(0, |binding| binding.group + 1));
            match variable.space {
                AddressSpace::Storage { .. } => used.storage_buffers += 1,
                AddressSpace::Uniform => {
                    used.uniform_buffers += 1;
                    used.uniform_bytes = used.uniform_bytes.max(size);
                }
                AddressSpace::WorkGroup => used.workgroup_bytes += size.next_multiple_of(16),
                AddressSpace::Handle => {
                    used.textures += u32::from(matches!(module.types[variable.ty].inner, TypeInner::Image { .. }));
                }
                _ => {}
            }
        }
        if entry.stage == ShaderStage::Compute {
            used.invocations = entry.workgroup_size.iter().product();
        }
        used
    }
}

fn used_by(text: &str) -> Used {
    let module = naga::front::wgsl::parse_str(text).unwrap();
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module).unwrap();
    Used::of(&module, &info)
}

/// Counts the choices of a shader that are only for adapters with more storage buffers.
fn more_buffers(shader: &str) -> u32 {
    let choices = format!("{shader},");
    WITH_MORE_BUFFERS.iter().filter(|choice| choices.contains(*choice)).count() as u32
}

/// Returns the table of the resources that each entry point uses: the maximum over all variants for adapters with the default limits, and the maximum
/// number of storage buffers over all other variants.
fn table() -> String {
    let mut rows: BTreeMap<String, (Used, u32)> = BTreeMap::new();
    for shader in shaders().unwrap() {
        let source = shader.resolve().unwrap();
        let used = used_by(&source.text);
        let more = more_buffers(&shader.to_string());
        assert!(
            used.is_within(WEBGPU, more),
            "{shader}: uses {used:?}, allowed are {WEBGPU:?} and {more} more storage buffers"
        );
        let (least, most) = rows.entry(source.name.to_owned()).or_default();
        if more == 0 {
            let greatest = |a: u32, b: u32| a.max(b);
            *least = Used {
                storage_buffers: greatest(least.storage_buffers, used.storage_buffers),
                uniform_buffers: greatest(least.uniform_buffers, used.uniform_buffers),
                textures: greatest(least.textures, used.textures),
                groups: greatest(least.groups, used.groups),
                workgroup_bytes: greatest(least.workgroup_bytes, used.workgroup_bytes),
                uniform_bytes: greatest(least.uniform_bytes, used.uniform_bytes),
                invocations: greatest(least.invocations, used.invocations),
            };
        }
        *most = (*most).max(used.storage_buffers);
    }
    let mut text = String::from(
        "| shader | storage buffers | with more | uniform buffers | textures | bind groups | workgroup memory, bytes |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (name, (used, most)) in rows {
        let Used { storage_buffers, uniform_buffers, textures, groups, workgroup_bytes, .. } = used;
        writeln!(
            text,
            "| `{name}.wgsl` | {storage_buffers} | {most} | {uniform_buffers} | {textures} | {groups} | {workgroup_bytes} |"
        )
        .unwrap();
    }
    text
}

const DOCUMENT: &str = "docs/adapters.md";
const MARKS: [&str; 2] = ["<!-- shaders -->\n", "<!-- end of shaders -->\n"];

#[test]
fn every_shader_is_within_the_limits_of_webgpu_as_documented() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(DOCUMENT);
    let document = fs::read_to_string(&path).unwrap();
    let (before, rest) = document.split_once(MARKS[0]).unwrap();
    let (_, after) = rest.split_once(MARKS[1]).unwrap();
    let written = format!("{before}{}{}{}{after}", MARKS[0], table(), MARKS[1]);
    if std::env::var_os("STERADIAN_WRITE_REFERENCE").is_some() {
        fs::write(&path, written).unwrap();
    } else {
        assert!(
            document == written,
            "{DOCUMENT}: the table of shaders is out of date; STERADIAN_WRITE_REFERENCE=1 writes it"
        );
    }
}

#[test]
fn a_shader_with_too_many_buffers_or_too_much_memory_is_found() {
    let buffers = |count: u32| {
        let declared = (0..count).map(|i| format!("@group(0) @binding({i}) var<storage, read_write> b{i}: u32;\n"));
        let used = (0..count).map(|i| format!("b{i} = 1u; "));
        format!(
            "{}@compute @workgroup_size(64) fn main() {{ {} }}",
            declared.collect::<String>(),
            used.collect::<String>()
        )
    };
    assert!(used_by(&buffers(8)).is_within(WEBGPU, 0));
    assert!(!used_by(&buffers(9)).is_within(WEBGPU, 0));
    assert!(used_by(&buffers(9)).is_within(WEBGPU, 1));
    let memory = |words: u32| {
        format!("var<workgroup> held: array<u32, {words}>; @compute @workgroup_size(1) fn main() {{ held[0] = 1u; }}")
    };
    assert!(used_by(&memory(4096)).is_within(WEBGPU, 0));
    assert!(!used_by(&memory(4097)).is_within(WEBGPU, 0));
    assert!(!used_by("@compute @workgroup_size(257) fn main() {}").is_within(WEBGPU, 0));
    let group =
        "@group(4) @binding(0) var<storage, read_write> b: u32; @compute @workgroup_size(1) fn main() { b = 1u; }";
    assert!(!used_by(group).is_within(WEBGPU, 0));
    assert_eq!(more_buffers("a, faint = display/faint_map, shown = display/shown_off"), 1);
    assert_eq!(more_buffers("a, shown = display/shown, tables = shared/tables_buffer, tabulated = b"), 2);
    assert_eq!(more_buffers("a, faint = display/faint_map_off, tables = shared/tables_texture"), 0);
}
