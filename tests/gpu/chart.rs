//! Tests the chart by tiny runs of every axis. The scores must distinguish correct methods from wrong ones.

mod live;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use glam::DVec2;
use steradian::{
    catalogue::{
        deep::{build::BuildOptions, synth::synthesise},
        galaxy::GalaxyParameters,
    },
    chart::{
        self, About, AsteroidExtent, AsteroidMetric, Axis, COLUMNS, DeepMetric, Extent, GlareExtent, GlareMetric,
        LiveDaemon, LiveExtent, LiveRequest, Metric, ProjectorMetric, Row, ScoringSize, Sky, ViewShape, read_csv,
        score_method, write_csv,
    },
    plan::settings::{GlareMethod, StarMethod},
};
use svg::{node::element::tag::Type, parser::Event};

/// Far longer than any run here takes, even on a busy machine, so that no frame is skipped for lack of time.
const AMPLE: Duration = Duration::from_secs(3600);

fn tiny() -> Extent {
    Extent {
        skies: [Sky::Bright, Sky::Galaxy(300)]
            .map(|sky| (sky, vec![ViewShape::Flat([160, 90]), ViewShape::FullSky([128, 64])]))
            .to_vec(),
        exposures: vec![-8.5],
        rounds: 2,
        budget: AMPLE,
        scoring: tiny_scoring(),
        scale: vec![200, 400],
        deep: vec![2000],
        stores: Vec::new(),
        many_views_stars: 300,
        projector: [480, 270],
        glare: GlareExtent {
            stars: 300,
            views: vec![
                (ViewShape::Flat([160, 90]), ViewShape::Flat([192, 108])),
                (ViewShape::Cubemap(32), ViewShape::Cubemap(48)),
                (ViewShape::Dome(64), ViewShape::Dome(128)),
            ],
            scored_stars: 300,
            pixels: 300,
            rounds: 2,
            budget: AMPLE,
        },
        asteroids: AsteroidExtent {
            instances: vec![200, 600],
            views: vec![ViewShape::Flat([160, 90]), ViewShape::Stereo([64, 64]), ViewShape::Dome(96)],
            other_views_instances: 200,
            ratio_instances: 600,
            ratio_px: 64,
            scored_px: 256,
            rounds: 2,
            budget: AMPLE,
        },
        live: LiveExtent { scenes: Vec::new(), rounds: 0, round: Duration::ZERO, poses: 0, budget: AMPLE },
    }
}

/// Returns an error instead of starting a daemon, for axes that need none.
fn no_daemons(_: &LiveRequest<'_>) -> Result<Box<dyn LiveDaemon>, String> {
    Err("this axis needs no daemon".to_owned())
}

fn tiny_scoring() -> ScoringSize {
    ScoringSize { image_px: 512, positions: 200, crowd: 400, heap: 1000, shuffles: 1 }
}

fn about() -> About {
    let (adapter, driver) = ("adapter <&> \"A\"".to_owned(), "driver".to_owned());
    About { adapter, driver, date: "2026-01-02 03:04 UTC".to_owned(), command: "steradian chart --out x".to_owned() }
}

/// Returns the texts of an SVG file. Panics if elements are not closed in the right order.
fn well_formed(text: &str) -> Vec<String> {
    let (mut open, mut texts) = (Vec::new(), Vec::new());
    for event in svg::read(text).unwrap() {
        match event {
            Event::Tag(name, Type::Start, _) => open.push(name.to_owned()),
            Event::Tag(name, Type::End, _) => assert_eq!(open.pop().as_deref(), Some(name)),
            Event::Tag(_, Type::Empty, _) | Event::Comment(_) | Event::Declaration(_) | Event::Instruction(_) => {}
            Event::Text(content) => texts.push(content.to_owned()),
            Event::Error(error) => panic!("{error}"),
        }
    }
    assert!(open.is_empty(), "{open:?} are not closed");
    texts
}

#[test]
fn a_tiny_run_has_every_method_and_fills_or_explains_every_cell() {
    let mut renderer = crate::common::renderer();
    let mut steps = Vec::new();
    let extent = tiny();
    let rows =
        chart::run(&mut renderer, &[Axis::Stars], &extent, &mut no_daemons, &mut |step| steps.push(step.clone()))
            .unwrap();
    assert!(steps.iter().enumerate().all(|(index, step)| step.done == index && step.total == steps.len()), "{steps:?}");

    let folder = tempfile::tempdir().unwrap();
    let files = chart::write(folder.path(), &rows, &about()).unwrap();
    let names: Vec<&str> = files.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["chart.csv", "stars.svg", "index.html"]);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();

    let csv = read("chart.csv");
    assert_eq!(csv.lines().next().unwrap(), COLUMNS.join(","));
    assert_eq!(
        csv.lines().next().unwrap(),
        "axis,method,source,workload,adapter,width,height,items,gpu_ms_median,gpu_ms_min,gpu_ms_max,error_metric,error_value,notes"
    );
    assert_eq!(read_csv(&csv).unwrap(), rows);
    // One row per method, workload and error metric.
    let keys: BTreeSet<_> = rows.iter().map(|row| (&row.method, &row.workload, &row.error_metric)).collect();
    assert_eq!(keys.len(), rows.len());
    assert_eq!(rows.len(), StarMethod::ALL.len() * Metric::ALL.len() * extent.workloads());
    for method in StarMethod::ALL {
        let of_method: Vec<&Row> = rows.iter().filter(|row| row.method == method.name()).collect();
        assert!(of_method.iter().all(|row| row.source == method.source().name()));
        for row in of_method {
            let times = [row.gpu_ms_min, row.gpu_ms_median, row.gpu_ms_max];
            match times {
                [Some(min), Some(median), Some(max)] => assert!(0.0 < min && min <= median && median <= max, "{row:?}"),
                _ => assert!(times == [None; 3] && row.error_value.is_none() && !row.notes.is_empty(), "{row:?}"),
            }
            assert!(
                row.error_value.is_some() || !row.notes.is_empty(),
                "an empty cell needs a note with the reason: {row:?}"
            );
            if !method.draws_catalogue() && row.error_value.is_some() {
                assert!(
                    row.notes.contains("stars of the sky itself") || row.error_metric == "order_bits_differ",
                    "{row:?}"
                );
            }
        }
    }
    assert!(rows.iter().any(|row| row.items == 300) && rows.iter().any(|row| row.workload == "bright full-sky-128"));

    let texts = well_formed(&read("stars.svg"));
    let html = read("index.html");
    for method in StarMethod::ALL {
        assert!(texts.iter().any(|text| text.contains(method.name())), "{} is missing in the picture", method.name());
        assert!(html.contains(&format!("<td>{}</td>", method.name())));
    }
    for part in ["adapter &lt;&amp;&gt;", "2026-01-02 03:04 UTC", "steradian chart --out x", "<img src=\"stars.svg\""] {
        assert!(html.contains(part), "{part}");
    }
}

/// The procedural sky is scored on its own stars. These are cones of brightness, sampled at pixel centres.
#[test]
fn the_procedural_sky_has_the_expected_errors_of_cones() {
    let mut renderer = crate::common::renderer();
    let scores = score_method(&mut renderer, StarMethod::CellSky, tiny_scoring(), AMPLE).unwrap();
    for metric in Metric::ALL {
        let score = scores.get(metric).cloned().unwrap_or_default();
        println!("cell_sky {}: {:?} ({})", metric.name(), score.value, score.note);
    }
    let value = |metric| scores.get(metric).and_then(|score| score.value);
    assert_eq!(value(Metric::OrderBitsDiffer), Some(0.0));
    assert_eq!([Metric::ColourUv, Metric::DynamicRange, Metric::Seam].map(value), [None; 3]);
    // For a cone with a radius of 1 px, the sum over pixel centres is pi / 3 on average. It varies from 0.83 (star on a corner) to 1 (star on a
    // centre).
    let sum = |at: DVec2| -> f64 {
        let offsets = (-2..3).flat_map(|y| (-2..3).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
        offsets.map(|offset| (1.0 - (offset - at).length()).max(0.0)).sum()
    };
    let sums: Vec<f64> = (0..10_000)
        .map(|i| sum(DVec2::new(f64::from(i % 100) + 0.5, f64::from(i / 100) + 0.5) / 100.0 - 0.5))
        .collect();
    let mean = sums.iter().sum::<f64>() / 1e4;
    let std = (sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / 1e4).sqrt();
    println!("cone of 1 px: mean of the sum {mean:.4}, std over mean {:.4}", std / mean);
    let linear = value(Metric::FlickerLinear).unwrap();
    assert!((linear / (std / mean) - 1.0).abs() < 0.3, "{linear} {}", std / mean);
    let flux = value(Metric::FluxStarRms).unwrap();
    let ellipticity = value(Metric::EllipticityView45Deg).unwrap();
    assert!(flux > linear && flux < 1.0, "{flux}");
    assert!(ellipticity > 0.1 && ellipticity < 1.0, "{ellipticity}");
}

/// Stars that are drawn directly into the pixels of a projector keep their light, position and width; resampled stars do not.
#[test]
#[ignore = "long: make test-all"]
fn a_tiny_run_of_projectors_shows_the_errors_of_resampling() {
    let mut renderer = crate::common::renderer();
    let rows = chart::run(&mut renderer, &[Axis::Projectors], &tiny(), &mut no_daemons, &mut |_| {}).unwrap();
    let figure = |method: &str, metric: ProjectorMetric| {
        let row = rows.iter().find(|row| row.method == method && row.error_metric == metric.name()).unwrap();
        println!("{method} {}: {:?}, {:?} ms", metric.name(), row.error_value, row.gpu_ms_median);
        assert!(row.gpu_ms_median.is_some_and(|ms| ms > 0.0), "{row:?}");
        row.error_value.unwrap()
    };
    assert_eq!(rows.len(), 4 * ProjectorMetric::ALL.len());
    let [direct, bent] =
        ["direct", "resampled"].map(|method| ProjectorMetric::ALL.map(|metric| figure(method, metric)));
    assert!(direct[0] < 1e-3 && direct[1] < 4e-3 && direct[2] < 2e-2, "{direct:?}");
    assert!(bent[0] > 10.0 * direct[0] && bent[3] > 1.02 * direct[3], "{bent:?}");
    let folder = tempfile::tempdir().unwrap();
    chart::write(folder.path(), &rows, &about()).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(well_formed(&read("projectors.svg")).iter().any(|text| text.contains("resampled_half")));
    assert!(read("index.html").contains("<td>resampled_double</td>"));
}

/// Makes a deep store of faint stars, of which the brightest are all resident.
fn faint_store(folder: &Path) -> PathBuf {
    let out = folder.join("faint");
    let parameters = GalaxyParameters { stars: 30_000, seed: 3, fainter_than: Some(13.0), unresolved_light: false };
    let options = BuildOptions { out: out.clone(), memory_bytes: 1 << 28, job: String::new(), cells: None };
    synthesise(&parameters, options, &mut |_| ()).unwrap();
    out
}

/// Tests the axes `views` and `scale`: times, one derived figure, and the figures of deep stores.
#[test]
#[ignore = "long: make test-all"]
fn views_and_scale_have_their_figures_over_several_rounds() {
    let folder = tempfile::tempdir().unwrap();
    let extent = &Extent { stores: vec![faint_store(folder.path())], ..tiny() };
    let mut renderer = crate::common::renderer();
    let rows = chart::run(&mut renderer, &[Axis::Views, Axis::Scale], extent, &mut no_daemons, &mut |_| {}).unwrap();
    for series in ["deep_store", "deep_store_dome"] {
        let value = |items: u64, metric: DeepMetric| {
            let of_metric =
                |row: &&Row| (&*row.method, row.items, &*row.error_metric) == (series, items, metric.name());
            rows.iter().find(of_metric).and_then(|row| row.error_value).unwrap_or_else(|| panic!("{series} {metric:?}"))
        };
        // The brightest stars are all resident, so no leaves are read, and no composite stars replace them.
        assert_eq!(value(2000, DeepMetric::ReadMib), 0.0);
        // The file has 30,000 stars of 8 bytes each, or fewer composite stars.
        let read = value(30_000, DeepMetric::ReadMib);
        assert!(read > 0.01 && read < 0.5, "{series}: {read} MiB");
        // A star of a leaf has 8 bytes in the file and 16 in memory; tiles also have a bit for each cell, which is not kept.
        let memory = value(30_000, DeepMetric::MemoryMib);
        let least = if series == "deep_store" { 2.0 * read } else { 0.01 };
        assert!(memory >= least && memory < 1.0, "{series}: {memory} MiB");
        let [most, largest] = [DeepMetric::Error999Codes, DeepMetric::ErrorLargestCodes].map(|m| value(30_000, m));
        assert!(most < 0.5 && largest >= most, "{series}: {most} {largest}");
        // In the small pixels of the window, stars of V = 13 are too bright for composite stars, so each is drawn. In the dome, they are in the map.
        assert_eq!(largest == 0.0, series == "deep_store", "{series}: {largest}");
    }
    let figure = |axis: &str, workload: &str, method: &str| {
        let found = rows.iter().find(|row| (&*row.axis, &*row.workload, &*row.method) == (axis, workload, method));
        found.unwrap_or_else(|| panic!("no row {axis}, {workload}, {method}"))
    };
    for method in StarMethod::ALL.map(StarMethod::name) {
        for stars in ["200", "400"] {
            let row = figure("scale", stars, method);
            assert_eq!(row.items.to_string(), stars);
            let per_star = row.gpu_ms_median.map(|ms| ms * 1e6 / row.items as f64);
            assert_eq!(row.error_value, per_star);
            assert!(per_star.is_some() || !row.notes.is_empty(), "{row:?}");
        }
        let mut apart = Some(0.0);
        for view in ["window", "stereo", "cubemap", "dome"] {
            let row = figure("views", view, method);
            assert_eq!(row.error_value, None);
            apart = apart.zip(row.gpu_ms_median).map(|(sum, ms)| sum + ms);
        }
        let together = figure("views", "all together", method);
        assert_eq!(together.error_value, together.gpu_ms_median.zip(apart).map(|(together, apart)| together / apart));
    }
    assert!(figure("scale", "400", "bspline").error_value.is_some());

    let files = chart::write(folder.path(), &rows, &about()).unwrap();
    let names: Vec<&str> = files.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["chart.csv", "views.svg", "scale.svg", "index.html"]);
    assert!(std::fs::read_to_string(folder.path().join("index.html")).unwrap().contains("read_mib"));
    for picture in ["views.svg", "scale.svg"] {
        let texts = well_formed(&std::fs::read_to_string(folder.path().join(picture)).unwrap());
        assert!(texts.iter().any(|text| text == "bspline") && texts.iter().any(|text| text == "tent"));
    }
}

/// `sky_cube` has correct scores in every projection, and the scores of the published pyramids show their known flaws.
#[test]
#[ignore = "long: make test-all"]
fn a_tiny_run_of_glare_has_the_figures_of_every_method() {
    let mut renderer = crate::common::renderer();
    let extent = tiny();
    let mut steps = Vec::new();
    let rows =
        chart::run(&mut renderer, &[Axis::Glare], &extent, &mut no_daemons, &mut |step| steps.push(step.clone()))
            .unwrap();
    assert!(steps.iter().enumerate().all(|(index, step)| step.done == index && step.total == steps.len()), "{steps:?}");
    let keys: BTreeSet<_> = rows.iter().map(|row| (&row.method, &row.workload, &row.error_metric)).collect();
    assert_eq!(keys.len(), rows.len());
    let methods: BTreeSet<&str> = rows.iter().map(|row| row.method.as_str()).collect();
    assert!(GlareMethod::DRAWING.iter().all(|method| methods.contains(method.name())), "{methods:?}");
    assert_eq!(rows.len(), 7 * GlareMetric::ALL.len() * extent.glare.views.len());
    let figure = |method: &str, workload: &str, metric: GlareMetric| {
        let key = (method, workload, metric.name());
        let found = rows.iter().find(|row| (&*row.method, &*row.workload, &*row.error_metric) == key);
        found.unwrap_or_else(|| panic!("no row {key:?}"))
    };
    let workloads = ["300 anticentre-90p", "300 cubemap-32", "300 dome-64"];
    for row in &rows {
        println!("{} {} {} {:?} {}", row.method, row.workload, row.error_metric, row.error_value, row.notes);
        let times = [row.gpu_ms_min, row.gpu_ms_median, row.gpu_ms_max];
        match times {
            [Some(min), Some(median), Some(max)] => assert!(0.0 < min && min <= median && median <= max, "{row:?}"),
            _ => assert!(times == [None; 3] && row.method == "none", "{row:?}"),
        }
        assert!(
            row.error_value.is_some() || !row.notes.is_empty(),
            "an empty cell needs a note with the reason: {row:?}"
        );
        assert_eq!(row.source == "smaller-than-pixels", row.method.contains("pyramid"));
        assert!(row.notes.contains("whole frame"), "{row:?}");
        assert_eq!(row.notes.contains("on the CPU"), row.method == "sky_cube_in_flight", "{row:?}");
    }
    for workload in workloads {
        let ours = |metric| figure("sky_cube", workload, metric).error_value;
        assert!(ours(GlareMetric::VeilRms).unwrap() < 0.03 && ours(GlareMetric::Roundness).unwrap() < 0.03);
        assert!((ours(GlareMetric::Slope).unwrap() + 2.0).abs() < 0.03);
        assert!((ours(GlareMetric::FluxKept).unwrap() - 1.0).abs() < 0.02);
        assert!(figure("none", workload, GlareMetric::VeilRms).error_value.is_none());
        for pyramid in ["screen_pyramid", "view_pyramid"] {
            assert!(figure(pyramid, workload, GlareMetric::VeilRms).error_value.unwrap() > 0.2, "{pyramid} {workload}");
        }
    }
    for workload in ["300 anticentre-90p", "300 dome-64"] {
        let outside = |method| figure(method, workload, GlareMetric::FromOutside).error_value.unwrap();
        assert!((outside("sky_cube") - 1.0).abs() < 0.02, "{}", outside("sky_cube"));
        assert_eq!([outside("screen_pyramid"), outside("view_pyramid_halved")], [0.0; 2]);
    }
    let seam = |method| figure(method, "300 cubemap-32", GlareMetric::Seam).error_value.unwrap();
    assert!(seam("sky_cube") < 0.05 && seam("screen_pyramid") > 0.5, "{} {}", seam("sky_cube"), seam("screen_pyramid"));

    let folder = tempfile::tempdir().unwrap();
    chart::write(folder.path(), &rows, &about()).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(read_csv(&read("chart.csv")).unwrap(), rows);
    let (texts, html) = (well_formed(&read("glare.svg")), read("index.html"));
    for method in methods {
        assert!(texts.iter().any(|text| text.contains(method)), "{method} is missing in the picture");
        assert!(html.contains(&format!("<td>{method}</td>")));
    }
    for workload in workloads {
        assert!(texts.iter().any(|text| text.contains(workload)) && html.contains(workload), "{workload}");
    }
}

/// Every method is timed, our own methods stay within the accuracy limits, and published times are marked as measured
/// on other hardware.
#[test]
#[ignore = "long: make test-all"]
fn asteroid_fields_of_several_sizes_have_the_figures_of_every_method() {
    let extent = &tiny();
    let mut renderer = crate::common::renderer();
    let mut steps = Vec::new();
    let rows =
        chart::run(&mut renderer, &[Axis::Asteroids], extent, &mut no_daemons, &mut |step| steps.push(step.clone()))
            .unwrap();
    assert!(steps.iter().enumerate().all(|(index, step)| step.done == index && step.total == steps.len()), "{steps:?}");
    let keys: BTreeSet<_> = rows.iter().map(|row| (&row.method, &row.workload, &row.error_metric)).collect();
    assert_eq!(keys.len(), rows.len());
    let (published, measured): (Vec<&Row>, Vec<&Row>) =
        rows.iter().partition(|row| row.method.starts_with("published"));
    assert!(published.len() == 10 && published.iter().all(|row| row.notes.contains("other hardware")));
    let flat = extent.asteroids.instances.iter().map(|instances| format!("{instances} asteroids 90p"));
    let other = ["200 asteroids stereo-64", "200 asteroids dome-96"].map(str::to_owned);
    let workloads: Vec<String> = flat.chain(other).collect();
    // There are three ratios for each of two culling methods, and six drawing methods in every workload.
    assert_eq!(measured.len(), 3 * 2 + 6 * workloads.len() * AsteroidMetric::ALL.len());
    for row in &measured {
        println!(
            "{} {} {:?} ms {} {:?} {}",
            row.method, row.workload, row.gpu_ms_median, row.error_metric, row.error_value, row.notes
        );
        assert!(row.gpu_ms_median.is_some_and(|ms| ms > 0.0), "{row:?}");
        assert!(row.error_value.is_some() || row.notes.contains("does not apply"), "{row:?}");
        assert!(row.notes.contains("plan on the CPU") && row.notes.contains("drawn: meshes"), "{row:?}");
    }
    let figure = |method: &str, workload: &str, metric: AsteroidMetric| {
        let key = (method, workload, metric.name());
        let found = rows.iter().find(|row| (&*row.method, &*row.workload, &*row.error_metric) == key);
        found.unwrap_or_else(|| panic!("no row {key:?}")).error_value
    };
    for workload in &workloads {
        for method in [
            "mesh_only",
            "cpu_culling",
            "gpu_culling_euler_atlas",
            "gpu_culling_octahedral",
            "gpu_culling_octahedral_blend",
            "gpu_culling_octahedral_splat",
        ] {
            let iou = figure(method, workload, AsteroidMetric::SilhouetteIou).unwrap();
            let outline = figure(method, workload, AsteroidMetric::OutlinePx).unwrap();
            assert!(iou > 0.6 && iou <= 1.0, "{method} {workload}: {iou}");
            assert!(outline < 1.0, "{method} {workload}: {outline}");
            let disparity = figure(method, workload, AsteroidMetric::DisparityPx);
            assert_eq!(disparity.is_some(), workload.contains("stereo"));
        }
        let light = figure("mesh_only", workload, AsteroidMetric::Light).unwrap();
        assert!(light < 0.3, "{workload}: {light}");
        let normals = figure("mesh_only", workload, AsteroidMetric::NormalDeg).unwrap();
        assert!(normals < 10.0, "{workload}: {normals}");
        // Culling on the CPU and on the GPU gives the same pictures.
        let [cpu, gpu] = ["cpu_culling", "gpu_culling_euler_atlas"]
            .map(|method| figure(method, workload, AsteroidMetric::SilhouetteIou).unwrap());
        assert!((cpu - gpu).abs() < 1e-3, "{cpu} {gpu}");
    }

    let folder = tempfile::tempdir().unwrap();
    chart::write(folder.path(), &rows, &about()).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(read_csv(&read("chart.csv")).unwrap(), rows);
    let (texts, html) = (well_formed(&read("asteroids.svg")), read("index.html"));
    for method in ["mesh_only", "gpu_culling_octahedral_blend", "published", "published_mesh_only"] {
        assert!(texts.iter().any(|text| text.contains(method)), "{method} is missing in the picture");
        assert!(html.contains(&format!("<td>{method}</td>")));
    }
    assert!(html.contains("outside_over_inside") && html.contains("published, other hardware"));
}

/// The scenes of the chart reproduce the scores of tent and B-spline that are known from closed forms and from measurements for the design.
#[test]
fn scores_equal_the_known_values_of_the_kernels() {
    let mut renderer = crate::common::renderer();
    let size = ScoringSize { positions: 1000, image_px: 1024, ..tiny_scoring() };
    let mut scores_of = |method| {
        let scores = score_method(&mut renderer, method, size, AMPLE).unwrap();
        let values: Vec<(&str, f64)> = Metric::ALL
            .into_iter()
            .filter(|metric| *metric != Metric::FluxTotal)
            .map(|metric| (metric.name(), scores.get(metric).unwrap().value.unwrap()))
            .collect();
        println!("{}: {values:?}", method.name());
        move |metric: Metric| values.iter().find(|value| value.0 == metric.name()).unwrap().1
    };
    let (tent, bspline) = (scores_of(StarMethod::Tent), scores_of(StarMethod::BSpline));
    // The values measured for the design with 3000 positions are 0.084 and 0.163 for the tent, and 0.011, 0.038 and 0.128 for the B-spline.
    assert!((tent(Metric::FlickerK1) - 0.084).abs() < 0.003 && (bspline(Metric::FlickerK1) - 0.011).abs() < 0.001);
    assert!((tent(Metric::FlickerK10) - 0.163).abs() < 0.005 && (bspline(Metric::FlickerK10) - 0.038).abs() < 0.002);
    assert!((bspline(Metric::FlickerK100) - 0.128).abs() < 0.003);
    // The B-spline has a constant width, but the tent does not.
    assert!(bspline(Metric::WidthVariation) < 0.005 && tent(Metric::WidthVariation) > 0.1);
    // At 45 degrees off axis, a circle on a flat image plane has an ellipticity of 1 - cos 45 degrees in the sky.
    assert!((bspline(Metric::EllipticityView45Deg) - (1.0 - 0.5_f64.sqrt())).abs() < 0.01);
    for scores in [&tent as &dyn Fn(Metric) -> f64, &bspline] {
        assert!(scores(Metric::FluxStarRms) < 1e-4 && scores(Metric::CentroidPx) < 0.005);
        // At the corners of a cube, rounding to the unit of the sums makes the light of a star vary by 1e-4 between the largest and the smallest
        // value.
        assert!(scores(Metric::FlickerLinear) < 1e-4 && scores(Metric::Seam) < 5e-4);
        assert!(scores(Metric::ColourUv) < 0.003 && scores(Metric::DynamicRange) < 0.02);
        assert!(scores(Metric::OrderBitsDiffer) == 0.0 && (scores(Metric::Keeps20000Stars) - 1.0).abs() < 1e-3);
    }
}

#[test]
fn a_nan_figure_is_refused() {
    let mut row = Row { method: "tent".to_owned(), ..Row::default() };
    assert!(write_csv(&[row.clone()]).is_ok());
    row.error_value = Some(f64::NAN);
    assert!(write_csv(&[row]).is_err());
}

#[test]
fn unknown_axes_are_usage_errors() {
    let folder = tempfile::tempdir().unwrap();
    for axis in ["rings", "nothing"] {
        let output = Command::new(env!("CARGO_BIN_EXE_steradian"))
            .args(["chart", "--out", "chart", "--quick", "--axis", axis])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(64), "{message}");
        assert!(
            message.contains(axis)
                && message.contains("must be one of stars, glare, asteroids, projectors, views, scale, live"),
            "{message}"
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
}
