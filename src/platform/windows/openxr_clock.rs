//! Extension of OpenXR that converts the system's clock to the runtime's: `XR_KHR_win32_convert_performance_counter_time`.

use openxr::ExtensionSet;

/// Requests the extension if it is available, and returns whether it is available.
pub(crate) fn enable(available: &ExtensionSet, wanted: &mut ExtensionSet) -> bool {
    wanted.khr_win32_convert_performance_counter_time = available.khr_win32_convert_performance_counter_time;
    available.khr_win32_convert_performance_counter_time
}
