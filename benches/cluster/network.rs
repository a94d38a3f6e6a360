//! The network of a measured cluster: loopback without encryption, or a network namespace per process on one bridge, with TLS. Namespaces can drop
//! arriving packets (with `nftables`), and can be cut off from a director. They need root, `ip` and `nft`.

use std::{
    error::Error,
    io::Write,
    net::TcpListener,
    path::Path,
    process::{Command, Stdio},
};

use crate::certificates::Authority;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Keys of `[cluster]` with TLS.
const TLS: &str = "tls = { ca = 'ca.pem', certificate = '{name}.pem', key = '{name}.key' }";
/// First part of the addresses in namespaces.
const SUBNET: &str = "10.77.0";

/// A network.
pub enum Network {
    /// Ports of the directors.
    Loopback(Vec<u16>),
    Namespaces(Namespaces),
}

/// One namespace per process.
pub struct Namespaces {
    prefix: String,
    directors: usize,
    hosts: Vec<String>,
}

fn run(program: &str, arguments: &[&str], input: &str) -> Outcome<()> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("{program}: {error}"))?;
    if let Some(mut stdin) = child.stdin.take() {
        stdin.write_all(input.as_bytes())?;
    }
    let output = child.wait_with_output()?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{program} {}: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr).trim()).into())
}

impl Namespaces {
    fn name(&self, host: &str) -> String {
        format!("{}-{host}", self.prefix)
    }

    fn address(&self, director: usize) -> String {
        format!("{SUBNET}.{}", director + 1)
    }

    /// Opens a namespace for each host, and connects them by a bridge in an additional namespace.
    fn open(directors: usize, hosts: &[String], shortest_timeout_us: Option<u32>) -> Outcome<Self> {
        let prefix = format!("stcl{}", std::process::id());
        let mut all = Self { prefix, directors, hosts: Vec::new() };
        let switch = all.name("switch");
        all.hosts.push("switch".to_owned());
        run("ip", &["netns", "add", &switch], "")?;
        run("ip", &["-n", &switch, "link", "add", "bridge", "type", "bridge"], "")?;
        run("ip", &["-n", &switch, "link", "set", "bridge", "up"], "")?;
        for (index, host) in hosts.iter().enumerate() {
            let (name, port) = (all.name(host), format!("port{index}"));
            // Addresses of nodes begin at 11, so that they differ from those of directors.
            let number = if index < directors { index + 1 } else { index - directors + 11 };
            let address = format!("{SUBNET}.{number}/24");
            all.hosts.push(host.clone());
            run("ip", &["netns", "add", &name], "")?;
            let pair = ["link", "add", "eth0", "netns", &name, "type", "veth", "peer", "name", &port, "netns", &switch];
            run("ip", &pair, "")?;
            run("ip", &["-n", &switch, "link", "set", &port, "master", "bridge"], "")?;
            run("ip", &["-n", &switch, "link", "set", &port, "up"], "")?;
            run("ip", &["-n", &name, "addr", "add", &address, "dev", "eth0"], "")?;
            run("ip", &["-n", &name, "link", "set", "lo", "up"], "")?;
            run("ip", &["-n", &name, "link", "set", "eth0", "up"], "")?;
            if let Some(us) = shortest_timeout_us {
                let set = format!("echo {us} > /proc/sys/net/ipv4/tcp_rto_min_us");
                run("ip", &["netns", "exec", &name, "sh", "-c", &set], "")?;
            }
        }
        Ok(all)
    }

    /// Replaces the packet filter of a host.
    fn filter(&self, host: &str, incoming: &str, outgoing: &str) -> Outcome<()> {
        let rules = format!(
            "flush ruleset\ntable inet filter {{\n\
             chain incoming {{\n type filter hook input priority 0; policy accept;\n{incoming}\n }}\n\
             chain outgoing {{\n type filter hook output priority 0; policy accept;\n{outgoing}\n }}\n}}\n"
        );
        run("ip", &["netns", "exec", &self.name(host), "nft", "-f", "-"], &rules)
    }
}

impl Drop for Namespaces {
    fn drop(&mut self) {
        for host in &self.hosts {
            // The namespace is missing if opening it failed.
            drop(run("ip", &["netns", "del", &self.name(host)], ""));
        }
    }
}

impl Network {
    /// Opens a network on ports of the loopback interface.
    pub fn loopback(directors: usize) -> Outcome<Self> {
        // Keep all listeners open at the same time, so that their ports differ.
        let listeners = (0..directors).map(|_| TcpListener::bind("127.0.0.1:0")).collect::<Result<Vec<_>, _>>()?;
        let ports = listeners.iter().map(|listener| Ok(listener.local_addr()?.port()));
        Ok(Self::Loopback(ports.collect::<std::io::Result<_>>()?))
    }

    /// Opens namespaces for the directors and nodes, and writes their certificates to a folder.
    pub fn namespaces(folder: &Path, directors: usize, nodes: &[String], timeout_us: Option<u32>) -> Outcome<Self> {
        let hosts: Vec<String> = (0..directors).map(|director| format!("d{director}")).chain(nodes.to_vec()).collect();
        let spaces = Namespaces::open(directors, &hosts, timeout_us)
            .map_err(|error| format!("namespaces need root, `ip` and `nft` (Debian: iproute2, nftables): {error}"))?;
        let authority = Authority::new("bench");
        authority.write(folder);
        let addresses: Vec<String> = (0..directors).map(|director| spaces.address(director)).collect();
        let addresses: Vec<&str> = addresses.iter().map(String::as_str).collect();
        authority.issue_for(folder, "director", "director", &addresses);
        nodes.iter().for_each(|node| authority.issue(folder, node, node));
        Ok(Self::Namespaces(spaces))
    }

    /// Endpoint of each director.
    pub fn endpoints(&self) -> Vec<String> {
        match self {
            Self::Loopback(ports) => ports.iter().map(|port| format!("tcp/127.0.0.1:{port}")).collect(),
            Self::Namespaces(spaces) => {
                (0..spaces.directors).map(|director| format!("tls/{}:7447", spaces.address(director))).collect()
            }
        }
    }

    /// Returns the keys of `[cluster]` for this network.
    pub fn keys(&self) -> &'static str {
        match self {
            Self::Loopback(_) => "",
            Self::Namespaces(_) => TLS,
        }
    }

    /// Returns a command that runs a program on a host.
    pub fn command(&self, host: &str, program: &str) -> Command {
        match self {
            Self::Loopback(_) => Command::new(program),
            Self::Namespaces(spaces) => {
                // `ip` replaces itself by the program, so the process number stays the same.
                let mut command = Command::new("ip");
                command.args(["netns", "exec", &spaces.name(host), program]);
                command
            }
        }
    }

    fn spaces(&self) -> Outcome<&Namespaces> {
        match self {
            Self::Loopback(_) => Err("this needs --namespaces".into()),
            Self::Namespaces(spaces) => Ok(spaces),
        }
    }

    /// Makes every host drop this many of a thousand arriving packets.
    pub fn lose(&self, thousandths: u32) -> Outcome<()> {
        let spaces = self.spaces()?;
        let rule = format!("numgen random mod 1000 < {thousandths} counter drop");
        spaces.hosts.iter().skip(1).try_for_each(|host| spaces.filter(host, &rule, ""))
    }

    /// Cuts a host off from these directors, and reconnects it to all others.
    pub fn cut_off(&self, host: &str, directors: &[usize]) -> Outcome<()> {
        let spaces = self.spaces()?;
        let rules = |word: &str| {
            let rule = |director: &usize| format!("ip {word} {} counter drop\n", spaces.address(*director));
            directors.iter().map(rule).collect::<String>()
        };
        spaces.filter(host, &rules("saddr"), &rules("daddr"))
    }
}
