//! Listening, and its access rules: an address that other machines reach needs access control, which can be reloaded.

use std::{
    io,
    net::{SocketAddr, ToSocketAddrs},
    path::Path,
    sync::Arc,
    time::Duration,
};

use tokio::{net::TcpListener, sync::watch};

use super::{Address, NetworkOptions, Reloads, ServeError};
use crate::{
    config::UNIX_PREFIX,
    platform::{
        signals::ReloadSignal,
        sockets::{LocalListener, LocalSocket},
    },
    service::{
        network::{
            access::{Access, AccessSource},
            connections::Listener,
        },
        time_source::TimeSource,
    },
};

/// A socket that the daemon listens on, with the access rules for which it was bound and the signal that reloads them.
pub(super) struct Listening {
    pub(super) listener: Listener,
    pub(super) address: Address,
    pub(super) access: Access,
    pub(super) hangups: ReloadSignal,
}

impl Listening {
    /// Reads the access rules and binds the address.
    pub(super) async fn open(network: &NetworkOptions) -> Result<Self, ServeError> {
        // Register for the signal before reading the rules: a signal that arrives later is remembered until they can be reloaded.
        let hangups = ReloadSignal::install()?;
        let access = network.access.as_ref().map_or_else(|| Ok(Access::default()), |source| source());
        let access = access.map_err(ServeError::Access)?;
        let (listener, address) = bind(&network.listen, &access).await?;
        Ok(Self { listener, address, access, hangups })
    }
}

/// Binds an address if the access rules allow it.
async fn bind(listen: &str, access: &Access) -> Result<(Listener, Address), ServeError> {
    if let Some(path) = listen.strip_prefix(UNIX_PREFIX).map(Path::new) {
        return Ok((Listener::Local(bind_unix(listen, path).await?), Address::Unix(path.to_owned())));
    }
    let wrong = |problem: String| ServeError::Address { listen: listen.to_owned(), problem };
    let addresses = tokio::net::lookup_host(listen).await.map_err(|error| wrong(error.to_string()))?;
    let addresses: Vec<SocketAddr> = addresses.collect();
    check_addresses(listen, &addresses, access)?;
    let bound = bind_first(addresses.into_iter()).await;
    let listener = bound.unwrap_or_else(|| Err(wrong("the host has no address".to_owned())))?;
    let address = Address::Tcp(listener.local_addr()?);
    Ok((Listener::Tcp(listener), address))
}

/// Checks whether [`run`](super::run) would listen on an address. Call this at the start, before slow work.
///
/// # Errors
///
/// The address is invalid or taken, the path of a socket leads to something else, or other machines reach the address
/// without encryption or access control.
pub fn check_listen(listen: &str, access: &Access) -> Result<(), ServeError> {
    if let Some(path) = listen.strip_prefix(UNIX_PREFIX).map(Path::new) {
        return match socket(listen, path)?.answers() {
            true => Err(ServeError::AddressInUse { address: Address::Unix(path.to_owned()) }),
            false => Ok(()),
        };
    }
    let wrong = |problem: String| ServeError::Address { listen: listen.to_owned(), problem };
    let addresses: Vec<SocketAddr> = listen.to_socket_addrs().map_err(|error| wrong(error.to_string()))?.collect();
    check_addresses(listen, &addresses, access)?;
    let mut first = None;
    for address in addresses {
        match std::net::TcpListener::bind(address) {
            // The socket is closed at once: the daemon binds the address again when it is ready.
            Ok(_) => return Ok(()),
            Err(source) => keep_clearest(&mut first, refusal(address, source)),
        }
    }
    first.map_or(Ok(()), Err)
}

/// Returns the socket of a path, which must lead to a socket or to nothing.
fn socket(listen: &str, path: &Path) -> Result<LocalSocket, ServeError> {
    let unsupported = |problem| ServeError::Unsupported { listen: listen.to_owned(), problem };
    let socket = LocalSocket::new(path).map_err(unsupported)?;
    match socket.obstacle() {
        Some(what) => Err(ServeError::NotSocket { path: path.to_owned(), what }),
        None => Ok(socket),
    }
}

impl Address {
    /// Removes the file of a Unix socket, unless the path now leads to something else; a failure is logged.
    pub(super) fn remove_socket(&self) {
        let Self::Unix(path) = self else { return };
        if !LocalSocket::new(path).is_ok_and(|socket| socket.exists()) {
            tracing::warn!("{self} is no longer a socket, so it is not removed");
        } else if let Err(error) = std::fs::remove_file(path) {
            tracing::warn!("cannot remove {self}: {error}");
        }
    }
}

fn check_addresses(listen: &str, addresses: &[SocketAddr], access: &Access) -> Result<(), ServeError> {
    let open = |problem| ServeError::Open { listen: listen.to_owned(), problem };
    addresses.iter().try_for_each(|address| access.check_address(*address)).map_err(open)
}

/// Binds a Unix socket that its owner and group may open. Replaces a socket that an earlier daemon left behind.
async fn bind_unix(listen: &str, path: &Path) -> Result<LocalListener, ServeError> {
    let address = || Address::Unix(path.to_owned());
    let refused = |source| ServeError::Bind { address: address(), source };
    let socket = socket(listen, path)?;
    if !socket.release().map_err(refused)? {
        return Err(ServeError::AddressInUse { address: address() });
    }
    socket.bind().map_err(refused)
}

/// Interval of warnings about a certificate.
const WARNINGS: Duration = Duration::from_secs(86_400);

/// Reloads the access rules on each signal, and warns of certificates that expire soon.
pub(super) async fn keep_access(
    mut reloads: Reloads,
    mut hangups: ReloadSignal,
    source: Option<AccessSource>,
    access: watch::Sender<Arc<Access>>,
    time: TimeSource,
) {
    let warn = |access: &Access| {
        for warning in access.warnings(time.machine_now()) {
            tracing::warn!("{warning}");
        }
    };
    let mut daily = tokio::time::interval(WARNINGS);
    loop {
        let reload = tokio::select! {
            reload = reloads.next(&mut hangups) => reload,
            // The first tick comes at once.
            _ = daily.tick() => {
                warn(&access.borrow());
                continue;
            }
        };
        if reload.is_none() {
            break;
        }
        let Some(source) = source.clone() else {
            tracing::info!("there are no access rules to reload");
            continue;
        };
        let read = tokio::task::spawn_blocking(move || source()).await;
        let read = read.unwrap_or_else(|error| Err(error.to_string()));
        let read = read.and_then(|read| access.borrow().check_successor(&read, time.machine_now()).map(|()| read));
        match read {
            Ok(read) => {
                let (tokens, certificates) = (read.tokens.len(), read.certificates.len());
                access.send_replace(Arc::new(read));
                warn(&access.borrow());
                tracing::info!("reloaded the access rules: {tokens} tokens, {certificates} certificates");
            }
            Err(problem) => tracing::error!("cannot reload the access rules, so the old ones stay in use: {problem}"),
        }
    }
    // Keep the channel open, so that its receivers keep waiting.
    access.closed().await;
}

/// Listens on the first address that works: a name may resolve to an IPv6 address on a machine without IPv6. Returns
/// `None` if there was no address. Of several errors, it returns the first, but prefers a port in use, which the user
/// can change.
async fn bind_first(addresses: impl Iterator<Item = SocketAddr>) -> Option<Result<TcpListener, ServeError>> {
    let mut first = None;
    for address in addresses {
        match TcpListener::bind(address).await {
            Ok(listener) => return Some(Ok(listener)),
            Err(source) => keep_clearest(&mut first, refusal(address, source)),
        }
    }
    first.map(Err)
}

fn refusal(address: SocketAddr, source: io::Error) -> ServeError {
    let address = Address::Tcp(address);
    match source.kind() {
        io::ErrorKind::AddrInUse => ServeError::AddressInUse { address },
        _ => ServeError::Bind { address, source },
    }
}

/// Keeps the first of several errors, but prefers a port in use.
fn keep_clearest(kept: &mut Option<ServeError>, error: ServeError) {
    if !matches!((&*kept, &error), (Some(ServeError::AddressInUse { .. }), _) | (Some(_), ServeError::Bind { .. })) {
        *kept = Some(error);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic on unexpected values")]
mod tests {
    use super::*;

    #[tokio::test]
    async fn every_address_is_tried_and_a_port_in_use_is_reported_first() {
        let local = SocketAddr::from(([127, 0, 0, 1], 0));
        let holder = TcpListener::bind(local).await.unwrap();
        let taken = holder.local_addr().unwrap();
        // Reserved for documentation (RFC 5737): no machine has it.
        let foreign = SocketAddr::from(([192, 0, 2, 1], 0));
        let listener = bind_first([foreign, taken, local].into_iter()).await.unwrap().unwrap();
        assert_ne!(listener.local_addr().unwrap().port(), taken.port());
        for addresses in [[foreign, taken], [taken, foreign]] {
            match bind_first(addresses.into_iter()).await.unwrap() {
                Err(ServeError::AddressInUse { address }) => assert_eq!(address, Address::Tcp(taken)),
                other => panic!("{other:?}"),
            }
        }
        match bind_first([foreign].into_iter()).await.unwrap() {
            Err(ServeError::Bind { address, .. }) => assert_eq!(address, Address::Tcp(foreign)),
            other => panic!("{other:?}"),
        }
        assert!(bind_first(std::iter::empty()).await.is_none());
    }
}
