//! The runtime: finds it through the system's loader, checks its capabilities, and opens its device and session.
#![expect(unsafe_code, reason = "the loader is a library of the system, and the runtime makes the Vulkan device")]

use std::mem;

use ash::vk::{self, Handle as _};
use openxr as xr;

use super::error::{During, XrError};
use crate::{
    gpu::{
        Gpu, GpuOptions,
        adopt::{DeviceMaker, NEWEST_API_VERSION, VulkanHandles},
    },
    platform::openxr_clock,
};

/// View configuration with the two eyes of a headset.
pub(super) const STEREO: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;

/// Loads the system's OpenXR loader, through which programs find the runtime.
///
/// # Errors
///
/// [`XrError::Loader`]: it is missing or invalid.
pub fn loader() -> Result<xr::Entry, XrError> {
    // SAFETY: the library of this name is the OpenXR loader, whose functions follow the specification.
    unsafe { xr::Entry::load(&()) }.map_err(|error| XrError::Loader(error.to_string()))
}

/// A runtime with a headset.
pub(super) struct Runtime {
    pub(super) instance: xr::Instance,
    pub(super) system: xr::SystemId,
    /// Name and version of the runtime.
    pub(super) name: String,
    /// Name of the system.
    pub(super) system_name: String,
    /// Whether the runtime's clock can be read, which is needed for the age of poses.
    pub(super) has_clock: bool,
}

/// Checks whether a loader and a runtime are set up on this system. Does not connect: the runtime's service need not
/// run.
///
/// # Errors
///
/// Names the missing component.
pub fn check_set_up() -> Result<(), XrError> {
    look().map(|_| ())
}

/// Returns the loader and the extensions of the active runtime.
fn look() -> Result<(xr::Entry, xr::ExtensionSet), XrError> {
    let entry = loader()?;
    let available = entry.enumerate_extensions().map_err(no_runtime("xrEnumerateInstanceExtensionProperties"))?;
    Ok((entry, available))
}

fn no_runtime(call: &'static str) -> impl Fn(xr::sys::Result) -> XrError {
    move |result| XrError::NoRuntime { call, result }
}

impl Runtime {
    /// Finds the runtime and its headset.
    pub(super) fn find() -> Result<Self, XrError> {
        let (entry, available) = look()?;
        let missing = |runtime: &str| XrError::MissingExtension {
            runtime: runtime.to_owned(),
            extension: "XR_KHR_vulkan_enable2",
            needed_for: "frames are drawn with Vulkan on a device of the runtime",
        };
        let mut wanted = xr::ExtensionSet::default();
        wanted.khr_vulkan_enable2 = available.khr_vulkan_enable2;
        let has_clock = openxr_clock::enable(&available, &mut wanted);
        let application = xr::ApplicationInfo {
            application_name: "steradian",
            application_version: 1,
            engine_name: "steradian",
            engine_version: 1,
            api_version: xr::Version::new(1, 0, 0),
        };
        let instance =
            entry.create_instance(&application, &wanted, &[], &()).map_err(no_runtime("xrCreateInstance"))?;
        let properties = instance.properties().during("xrGetInstanceProperties")?;
        let name = format!("{} {}", properties.runtime_name, properties.runtime_version);
        if !available.khr_vulkan_enable2 {
            return Err(missing(&name));
        }
        let system = instance.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY);
        let system = system.map_err(|result| XrError::NoHeadset { runtime: name.clone(), result })?;
        let system_name = instance.system_properties(system).during("xrGetSystemProperties")?.system_name;
        let configurations = instance.enumerate_view_configurations(system);
        let configurations = configurations.during("xrEnumerateViewConfigurations")?;
        if !configurations.contains(&STEREO) {
            let problem = format!("it has no stereo views, only {configurations:?}");
            return Err(XrError::Unsuitable { runtime: name, problem });
        }
        Ok(Self { instance, system, name, system_name, has_clock })
    }

    /// Lets the runtime create the device that draws for the headset.
    pub(super) fn open_gpu(&self) -> Result<(Gpu, VulkanHandles), XrError> {
        let requirements = self.instance.graphics_requirements::<xr::Vulkan>(self.system);
        let requirements = requirements.during("xrGetVulkanGraphicsRequirements2KHR")?;
        let least = requirements.min_api_version_supported;
        let newest = NEWEST_API_VERSION;
        let (major, minor) = (vk::api_version_major(newest), vk::api_version_minor(newest));
        if (u32::from(least.major()), u32::from(least.minor())) > (major, minor) {
            let problem = format!("it needs Vulkan {least}, but frames are drawn with Vulkan {major}.{minor} at most");
            return Err(XrError::Unsuitable { runtime: self.name.clone(), problem });
        }
        Gpu::adopt(&RuntimesDevice(self), &GpuOptions::default())
    }

    /// Returns the current time of the runtime's clock; `None` if it cannot be read.
    pub(super) fn now(&self) -> Result<Option<xr::Time>, XrError> {
        if !self.has_clock {
            return Ok(None);
        }
        self.instance.now().during("the runtime's clock").map(Some)
    }
}

struct RuntimesDevice<'a>(&'a Runtime);

/// Returns Vulkan's function that finds all others, in the type of OpenXR's interface.
fn get_instance_proc_addr(loader: &ash::Entry) -> xr::sys::platform::VkGetInstanceProcAddr {
    let function: vk::PFN_vkGetInstanceProcAddr = loader.static_fn().get_instance_proc_addr;
    // SAFETY: both are pointers to the same C function; the crates name its handle and its result differently.
    unsafe { mem::transmute(function) }
}

// SAFETY: the runtime creates instance, physical device and device from the given information and adds its own
// requirements; according to XR_KHR_vulkan_enable2 the program owns the results.
unsafe impl DeviceMaker for RuntimesDevice<'_> {
    type Error = XrError;

    fn instance(&self, loader: &ash::Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<vk::Instance, XrError> {
        let call = "xrCreateVulkanInstanceKHR";
        let info = std::ptr::from_ref(info).cast();
        let Runtime { instance, system, .. } = self.0;
        // SAFETY: `info` is a VkInstanceCreateInfo that lives through the call.
        let made = unsafe { instance.create_vulkan_instance(*system, get_instance_proc_addr(loader), info) };
        let made = made.during(call)?.map_err(|result| XrError::Vulkan { call, result })?;
        Ok(vk::Instance::from_raw(made as u64))
    }

    fn physical_device(&self, instance: vk::Instance) -> Result<vk::PhysicalDevice, XrError> {
        let Runtime { instance: xr_instance, system, .. } = self.0;
        // SAFETY: the instance was made by `instance` above.
        let chosen = unsafe { xr_instance.vulkan_graphics_device(*system, instance.as_raw() as _) };
        Ok(vk::PhysicalDevice::from_raw(chosen.during("xrGetVulkanGraphicsDevice2KHR")? as u64))
    }

    fn device(
        &self,
        loader: &ash::Entry,
        physical_device: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, XrError> {
        let call = "xrCreateVulkanDeviceKHR";
        let info = std::ptr::from_ref(info).cast();
        let Runtime { instance, system, .. } = self.0;
        let function = get_instance_proc_addr(loader);
        // SAFETY: the physical device is the runtime's choice, and `info` a VkDeviceCreateInfo that lives through the call.
        let made = unsafe { instance.create_vulkan_device(*system, function, physical_device.as_raw() as _, info) };
        let made = made.during(call)?.map_err(|result| XrError::Vulkan { call, result })?;
        Ok(vk::Device::from_raw(made as u64))
    }
}

impl Runtime {
    /// Opens a session that draws with the device of these handles.
    pub(super) fn open_session(
        &self,
        handles: &VulkanHandles,
    ) -> Result<(xr::Session<xr::Vulkan>, xr::FrameWaiter, xr::FrameStream<xr::Vulkan>), XrError> {
        let info = xr::vulkan::SessionCreateInfo {
            instance: handles.instance as _,
            physical_device: handles.physical_device as _,
            device: handles.device as _,
            queue_family_index: handles.queue_family_index,
            queue_index: handles.queue_index,
        };
        // SAFETY: the handles belong to the device created by this runtime. The device outlives the session, because
        // the owner of both drops the session first.
        unsafe { self.instance.create_session::<xr::Vulkan>(self.system, &info) }.during("xrCreateSession")
    }
}
