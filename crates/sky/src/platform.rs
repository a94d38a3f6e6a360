//! Code that depends on the operating system: permissions of new files.

/// Gives a temporary file the permissions of any new file: on Unix only its owner could read it otherwise. On Windows it inherits those of
/// its folder, as every new file does.
pub(crate) fn share(builder: &mut tempfile::Builder<'_, '_>) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    #[cfg(not(unix))]
    let _ = builder;
}
