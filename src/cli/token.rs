//! `token`: makes an access token for a client.

use clap::Args;

use super::{CliError, results};
use crate::{
    config::{Role, Sha256Hex, TokenConfig, check_holder},
    service,
};

/// Arguments of `token`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
    steradian token --name desk-1 --role steer\n\n\
    The first line is the token for the client; it is not stored anywhere. Add the other lines to the\n\
    configuration; a running daemon reads them on SIGHUP.")]
pub struct TokenArguments {
    /// Name of the client, for the log.
    #[arg(long, value_name = "NAME")]
    name: String,
    /// Role of the client: view, steer or admin.
    #[arg(long, value_name = "ROLE")]
    role: Role,
}

#[derive(serde::Serialize)]
struct Server {
    tokens: [TokenConfig; 1],
}

#[derive(serde::Serialize)]
struct Document {
    server: Server,
}

/// Runs the command.
pub fn run(TokenArguments { name, role }: &TokenArguments) -> Result<(), CliError> {
    check_holder(name).map_err(|problem| CliError::Usage(format!("--name {problem}")))?;
    let token = service::new_token().map_err(CliError::Token)?;
    let sha256 = Sha256Hex(service::digest_of(&token));
    let tokens = [TokenConfig { name: name.clone(), role: *role, sha256 }];
    let lines = toml::to_string(&Document { server: Server { tokens } });
    let lines = lines.map_err(|error| CliError::Token(error.to_string()))?;
    results::line(token)?;
    results::line("")?;
    results::line(lines.trim_end())
}
