//! `serve`: the daemon.

pub(super) mod cluster;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use tokio::runtime::Runtime;
use tokio::task;

use self::cluster::ClusterRole;
use super::{
    CliError,
    load::{self, LoadedScene, PendingObjects},
    results, show,
};
use crate::config::{Config, PackingConfig, WindowConfig, parse_listen};
use crate::gpu::{Gpu, GpuOptions};
use crate::plan::view_settings::FrameGroup;
use crate::platform::{signals, supervisor};
use crate::render::{FrameRequest, Renderer, Wanted};
use crate::scene::loader::{LoadReport, LoadedCatalogue};
use crate::scene::{Camera, SceneSnapshot};
use crate::service::{
    self, Access, AccessSource, Address, EarlyServer, HeadsetOptions, NetworkOptions, SceneCatalogue, ServeError,
    ServeOptions, Shutdown, StartProgress, WindowsEnd, WindowsOptions,
};
use crate::view::Rig;
use crate::windows::{self, WindowsError, WithoutDisplay};
use crate::xr::{self, FirstFailure};

/// Arguments of `serve`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    steradian serve\n  \
    steradian serve --config configs/mission-control.toml --listen unix:steradian.socket\n  \
    steradian serve --listen 127.0.0.1:0     # selects a free port and prints it\n\n\
    Listens at once; prints `listening on ADDR` when it serves. Until then health is NOT_SERVING, and calls get\n\
    UNAVAILABLE with the progress. SIGINT and SIGTERM drain calls and shut down.\n\
    Every address except loopback and unix:PATH needs [server.tls], and [[server.tokens]] or\n\
    [[server.certificates]] in the configuration. SIGHUP reads these again.")]
pub struct ServeArguments {
    /// Configuration file. Default: a dome and a flat view of bright and synthetic stars.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Address to listen on; replaces the one in the configuration.
    #[arg(long, value_name = "ADDR", value_parser = parse_listen)]
    listen: Option<String>,
    /// File that keeps changes made by clients; replaces the one in the configuration.
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    /// Override a key of the configuration; can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Role of this daemon in the cluster that `[cluster]` and `[[nodes]]` of the configuration describe.
    #[arg(long, value_enum, value_name = "ROLE")]
    role: Option<ClusterRole>,
    /// Name of the node, with `--role node`.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Address of `cluster.endpoints` to listen on, with `--role director`. Default: the first one.
    #[arg(long, value_name = "ENDPOINT")]
    endpoint: Option<String>,
    /// Shut down when standard input is closed. This also happens when the process at its other end ends, for whatever reason.
    #[arg(long)]
    until_input_closes: bool,
}

/// Runs the command.
pub fn run(arguments: ServeArguments, options: &GpuOptions) -> Result<(), CliError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(CliError::Runtime)?;
    {
        // Prevent the signal that reloads the access rules from ending the process. The signal may be ignored until the daemon listens, because the
        // rules are read again then.
        let _inside = runtime.enter();
        signals::survive_hangup().map_err(CliError::Runtime)?;
    }
    let config = Config::load_or_built_in(arguments.config.as_deref(), &arguments.set)?;
    // The scene's clock starts when the configuration is read.
    let clock = config.clock();
    let (rig, camera) = (config.rig()?, config.camera()?);
    let groups = config.frame_groups()?;
    for view in config.views.iter().filter(|view| view.packing != PackingConfig::None) {
        tracing::info!("{}: views.{}.packing applies only to `render` and `film`", config.origin, view.name);
    }
    let part = cluster::part(&config, &arguments)?;
    let access = access(&arguments);
    let listen = arguments.listen.clone().unwrap_or_else(|| match &part {
        Some(part) => part.listen(&config),
        None => config.server.listen.clone(),
    });
    let current = access().map_err(|problem| CliError::Serve(ServeError::Access(problem)))?;
    service::check_listen(&listen, &current).map_err(CliError::Serve)?;
    let is_node = part.as_ref().is_some_and(|part| part.node.is_some());
    // A node takes over the director's state.
    let configured = config.server.state.as_ref().map(|state| config.folder.join(state)).filter(|_| !is_node);
    let state = arguments.state.clone().or(configured);
    if let Some(path) = &state {
        service::check_state(path).map_err(|error| CliError::Serve(error.into()))?;
    }
    let objects = PendingObjects::begin(&config);
    let renderer = Renderer::new(Gpu::open(options)?);
    renderer.check(&rig).map_err(|error| CliError::render(error.into(), &config.origin))?;
    block_on_and_leave(runtime, async {
        // From here on, a signal causes an orderly shutdown, even while stars are still loading.
        let (signals, input) = (service::signals().map_err(CliError::Runtime)?, input_closes(&arguments));
        let mut signals = Box::pin(async {
            tokio::select! { () = signals => {}, () = input => {} }
        });
        let network = NetworkOptions { listen, hosts: config.server.hosts.clone(), access: Some(access) };
        let progress = Arc::new(StartProgress::default());
        let early = EarlyServer::open(&network, Arc::clone(&progress)).await.map_err(CliError::Serve)?;
        let of_scene = config.clone();
        // Compile the shaders before a client can request a frame.
        let starting = task::spawn_blocking(move || start(&of_scene, objects, &groups, camera, renderer, &progress));
        let started = tokio::select! {
            () = &mut signals => None,
            started = starting => match started {
                Ok(started) => Some(started),
                // The task is never cancelled, so it panicked: propagate the panic.
                Err(error) => std::panic::resume_unwind(error.into_panic()),
            },
        };
        let (renderer, scene, report) = match started {
            Some(Ok(started)) => started,
            not_started => {
                early.give_up().await;
                return not_started.map_or(Ok(()), |started| started.map(drop));
            }
        };
        let adapter_name = renderer.adapter().adapter.clone();
        let cluster = part.as_ref().map(|part| part.options(&config, renderer.adapter())).transpose()?;
        let settings = config.render_settings();
        let mut options = ServeOptions::new(network.listen.clone(), Box::new(renderer), scene, rig, settings, announce);
        options.network = network;
        options.early = Some(early);
        let catalogue = |loaded: LoadedCatalogue| SceneCatalogue { name: loaded.name, stars: loaded.stars as u64 };
        options.scene.clock = Some(clock);
        options.scene.catalogues = report.catalogues.into_iter().map(catalogue).collect();
        options.scene.asteroid_fields = config.field_specs()?;
        options.scene.observer.clone_from(&config.scene.observer);
        options.scene.star_sources = config.star_sources();
        options.views.specs.clone_from(&config.views);
        options.views.folder.clone_from(&config.folder);
        options.state = state;
        options.headset = headset(&config).filter(|_| !is_node);
        let shown = part.as_ref().map_or_else(|| config.windows.clone(), |part| part.windows(&config));
        options.windows = windows(shown, &options.views.rig, adapter_name);
        options.cluster = cluster;
        options.shutdown = Shutdown::When(Box::pin(async move {
            signals.await;
            supervisor::stopping();
        }));
        service::run(options).await.map_err(CliError::Serve)
    })
}

/// Resolves when standard input is closed, if the arguments request this; otherwise never.
fn input_closes(arguments: &ServeArguments) -> impl Future<Output = ()> + Send + use<> {
    let (sender, closed) = tokio::sync::oneshot::channel();
    let watches = arguments.until_input_closes;
    if watches {
        // Use a thread, because reads of standard input cannot be cancelled.
        std::thread::spawn(move || {
            // A failed read is treated like a closed input.
            let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
            sender.send(())
        });
    }
    async move {
        if watches {
            let _ = closed.await;
        } else {
            std::future::pending().await
        }
    }
}

/// Returns the source of access rules, which reads the configuration again on each reload. The views of a file are not built: that takes seconds with
/// projectors, and rules can change while a calibration is replaced.
fn access(arguments: &ServeArguments) -> AccessSource {
    let arguments = arguments.clone();
    Arc::new(move || {
        let config = match &arguments.config {
            Some(path) => Config::load_unbuilt(path, &arguments.set),
            None => Config::built_in(&arguments.set),
        };
        let config = config.map_err(|error| error.to_string())?;
        Access::from_config(&config.server, &config.folder).map_err(|problem| format!("{}: {problem}", config.origin))
    })
}

/// Loads the scene and everything that the first images for displays and windows need. Shaders of other images are compiled while the daemon serves, and
/// exact images prepare their glare when they are first requested. A frame that cannot be drawn is logged here and reported to every client that
/// requests it: the scene may have changed by then.
fn start(
    config: &Config,
    objects: PendingObjects,
    groups: &[FrameGroup],
    camera: Camera,
    mut renderer: Renderer,
    progress: &StartProgress,
) -> Result<(Renderer, SceneSnapshot, LoadReport), CliError> {
    let mut wanted = Wanted::display();
    wanted |= show::wanted_by(&config.windows);
    let LoadedScene { stars, report, objects, prepared } =
        load::scene(config, objects, groups, wanted, &mut renderer, Some(progress))?;
    progress.tell("frame", "first frame".to_owned());
    let scene = SceneSnapshot { revision: 1, stars: Arc::new(stars), objects, camera };
    let drawn = prepared.and_then(|()| {
        let mut requests = (0..groups.len()).map(|number| FrameRequest::for_group(&scene, groups, number));
        requests.try_for_each(|request| renderer.render(request.wanted(Wanted::display())).map(drop))
    });
    if let Err(error) = drawn {
        tracing::warn!("the first frame cannot be drawn: {error}");
    } else if let Err(error) = renderer.prepare_later(&scene.objects, groups, Wanted::both()) {
        tracing::warn!("exact images cannot be drawn: {error}");
    }
    Ok((renderer, scene, report))
}

/// Returns the headset options of a configuration.
fn headset(config: &Config) -> Option<HeadsetOptions> {
    let settings = config.headset.clone();
    settings.enabled.then(|| HeadsetOptions {
        name: settings.name.clone(),
        // The runtime may start later than the daemon, so a first failure is retried.
        drive: Box::new(move |host| Ok(xr::drive(host.as_ref(), &settings, FirstFailure::Retries)?)),
    })
}

/// Returns the windows options of a configuration; windows use the named adapter if it can present.
fn windows(configs: Vec<WindowConfig>, rig: &Rig, adapter: String) -> Option<WindowsOptions> {
    let sizes: Vec<[u32; 2]> = configs.iter().filter_map(|window| show::size_of(window, rig)).collect();
    (!configs.is_empty()).then(|| WindowsOptions {
        windows: configs.clone(),
        open: Box::new(move |host| match windows::open(&configs, &sizes, &adapter, host, WithoutDisplay::GoesOn) {
            Ok(()) => WindowsEnd::InOrder,
            // The display may start later than the daemon.
            Err(WindowsError::NoDisplay(problem)) => WindowsEnd::NoDisplay(problem),
            Err(error) => WindowsEnd::Failed(error.to_string()),
        }),
    })
}

/// Runs a future to completion. Does not wait for the blocking threads of the runtime, which may still load stars or
/// encode frames for clients that are disconnected already.
fn block_on_and_leave<T>(runtime: Runtime, future: impl Future<Output = T>) -> T {
    let value = runtime.block_on(future);
    runtime.shutdown_background();
    value
}

/// Prints the line that scripts wait for.
fn announce(address: Address) {
    if let Err(error) = results::line(format!("listening on {address}")) {
        // The daemon also works if nothing reads its output.
        tracing::warn!("{error}");
    }
    supervisor::ready();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{sync::mpsc, thread, time::Duration};

    #[test]
    fn busy_blocking_threads_do_not_delay_shutdown() {
        let (release, released) = mpsc::channel::<()>();
        let (begun, has_begun) = mpsc::channel();
        let (end, ended) = mpsc::channel();
        thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().expect("a runtime");
            let value = block_on_and_leave(runtime, async {
                task::spawn_blocking(move || {
                    begun.send(()).expect("the test waits for it");
                    released.recv()
                });
                has_begun.recv().expect("the work begins");
                7
            });
            end.send(value)
        });
        assert_eq!(
            ended.recv_timeout(Duration::from_secs(30)),
            Ok(7),
            "the function returns while the work still blocks"
        );
        release.send(()).expect("the work still waits");
    }
}
