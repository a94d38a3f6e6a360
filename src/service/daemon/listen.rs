//! Listening, and its access rules: an address that other machines reach needs access control, which can be reloaded.

use std::{
    io,
    net::{SocketAddr, ToSocketAddrs},
    path::Path,
    sync::Arc,
};

use tokio::{
    net::{TcpListener, UnixListener, UnixStream},
    signal,
    sync::watch,
};

use super::{Address, Reloads, ServeError};
use crate::{
    config::UNIX_PREFIX,
    service::network::{
        access::{Access, AccessSource},
        connections::Listener,
    },
};

/// Binds an address if the access rules allow it.
pub(super) async fn bind(listen: &str, access: &Access) -> Result<(Listener, Address), ServeError> {
    if let Some(path) = listen.strip_prefix(UNIX_PREFIX).map(Path::new) {
        return Ok((Listener::Unix(bind_unix(path).await?), Address::Unix(path.to_owned())));
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

/// Checks, before slow work at the start, whether [`run`](super::run) would listen on an address.
///
/// # Errors
///
/// The address is invalid, or other machines reach it without encryption or access control.
pub fn check_listen(listen: &str, access: &Access) -> Result<(), ServeError> {
    if listen.starts_with(UNIX_PREFIX) {
        return Ok(());
    }
    let wrong = |error: io::Error| ServeError::Address { listen: listen.to_owned(), problem: error.to_string() };
    check_addresses(listen, &listen.to_socket_addrs().map_err(wrong)?.collect::<Vec<_>>(), access)
}

fn check_addresses(listen: &str, addresses: &[SocketAddr], access: &Access) -> Result<(), ServeError> {
    let open = |problem| ServeError::Open { listen: listen.to_owned(), problem };
    addresses.iter().try_for_each(|address| access.check_address(*address)).map_err(open)
}

/// Binds a Unix socket that its owner and group may open. Replaces a socket that an earlier daemon left behind.
async fn bind_unix(path: &Path) -> Result<UnixListener, ServeError> {
    const OWNER_AND_GROUP: u32 = 0o117;
    let address = || Address::Unix(path.to_owned());
    let refused = |source| ServeError::Bind { address: address(), source };
    match UnixStream::connect(path).await {
        Ok(_) => return Err(ServeError::AddressInUse { address: address() }),
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {
            std::fs::remove_file(path).map_err(refused)?;
        }
        // There is no socket, or it cannot be opened: binding reports it.
        Err(_) => {}
    }
    let mask = rustix::process::umask(rustix::fs::Mode::from_raw_mode(OWNER_AND_GROUP));
    let listener = UnixListener::bind(path);
    rustix::process::umask(mask);
    listener.map_err(refused)
}

/// Reloads the access rules on each signal.
pub(super) async fn keep_access(
    mut reloads: Reloads,
    mut hangups: signal::unix::Signal,
    source: Option<AccessSource>,
    access: watch::Sender<Arc<Access>>,
) {
    while reloads.next(&mut hangups).await.is_some() {
        let Some(source) = source.clone() else {
            tracing::info!("there are no access rules to reload");
            continue;
        };
        let read = tokio::task::spawn_blocking(move || source()).await;
        let read = read.unwrap_or_else(|error| Err(error.to_string()));
        let read = read.and_then(|read| access.borrow().check_successor(&read).map(|()| read));
        match read {
            Ok(read) => {
                let (tokens, certificates) = (read.tokens.len(), read.certificates.len());
                access.send_replace(Arc::new(read));
                tracing::info!("reloaded the access rules: {tokens} tokens, {certificates} certificates");
            }
            Err(problem) => tracing::error!("cannot reload the access rules, the old ones stay: {problem}"),
        }
    }
    // Keep the channel open, so that its receivers keep waiting.
    access.closed().await;
}

/// Listens on the first address that works: a name may resolve to an IPv6 address on a machine without IPv6. Returns
/// `None` if there was no address. Of several errors, it returns the first, but prefers a port in use, which the user
/// can change.
async fn bind_first(addresses: impl Iterator<Item = SocketAddr>) -> Option<Result<TcpListener, ServeError>> {
    let mut refusal = None;
    for address in addresses {
        let error = match TcpListener::bind(address).await {
            Ok(listener) => return Some(Ok(listener)),
            Err(source) if source.kind() == io::ErrorKind::AddrInUse => {
                ServeError::AddressInUse { address: Address::Tcp(address) }
            }
            Err(source) => ServeError::Bind { address: Address::Tcp(address), source },
        };
        if !matches!(
            (&refusal, &error),
            (Some(ServeError::AddressInUse { .. }), _) | (Some(_), ServeError::Bind { .. })
        ) {
            refusal = Some(error);
        }
    }
    refusal.map(Err)
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
