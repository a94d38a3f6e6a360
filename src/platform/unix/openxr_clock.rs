//! Extension of OpenXR that converts the system's clock to the runtime's: `XR_KHR_convert_timespec_time`.

use openxr::ExtensionSet;

/// Requests the extension if it is available, and returns whether it is available.
pub(crate) fn enable(available: &ExtensionSet, wanted: &mut ExtensionSet) -> bool {
    wanted.khr_convert_timespec_time = available.khr_convert_timespec_time;
    available.khr_convert_timespec_time
}
