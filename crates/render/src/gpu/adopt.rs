//! Adopting a Vulkan device that somebody else has made, as an OpenXR runtime does, and images that it hands out.
//!
//! The only place of this module where code is not checked by the compiler: each block says why it holds.
#![expect(unsafe_code, reason = "handles of Vulkan come from the runtime of a headset")]

use std::ffi::CStr;

use ash::vk::{self, Handle};
use wgpu::hal::{self, api::Vulkan};

use super::{Gpu, GpuError, GpuOptions, device::Selection};

/// Newest version of Vulkan that is asked for: the one that wgpu asks for itself.
pub const NEWEST_API_VERSION: u32 = vk::API_VERSION_1_3;

/// Makes the instance and the device of Vulkan.
///
/// # Safety
///
/// What the calls return must be made from what they were given: the instance through the loader's function and with at
/// least the extensions of its information, the physical device of that instance, and the device of that physical
/// device with at least the extensions, features and queues of its information. Nobody else may destroy them.
pub unsafe trait DeviceMaker {
    /// Why something could not be made.
    type Error: From<GpuError>;

    /// Makes the instance.
    fn instance(&self, loader: &ash::Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<vk::Instance, Self::Error>;

    /// Chooses the physical device.
    fn physical_device(&self, instance: vk::Instance) -> Result<vk::PhysicalDevice, Self::Error>;

    /// Makes the device.
    fn device(
        &self,
        loader: &ash::Entry,
        physical_device: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, Self::Error>;
}

/// Raw handles of an adopted device, for those who made it. They are valid as long as the [`Gpu`] is.
#[derive(Clone, Copy, Debug)]
pub struct VulkanHandles {
    pub instance: u64,
    pub physical_device: u64,
    pub device: u64,
    pub queue_family_index: u32,
    pub queue_index: u32,
}

fn refused(what: &str, error: impl std::fmt::Display) -> GpuError {
    GpuError::Adopt(format!("{what}: {error}"))
}

impl Gpu {
    /// Opens the device that `maker` makes.
    ///
    /// # Errors
    ///
    /// What `maker` says, or that the device cannot be used.
    pub fn adopt<M: DeviceMaker>(maker: &M, options: &GpuOptions) -> Result<(Self, VulkanHandles), M::Error> {
        // SAFETY: the loader is the system's Vulkan library, which keeps to Vulkan's interface.
        let loader = unsafe { ash::Entry::load() }.map_err(|error| refused("no Vulkan loader", error))?;
        // SAFETY: the loader was loaded just now.
        let available = unsafe { loader.try_enumerate_instance_version() };
        let available = available.map_err(|error| refused("Vulkan's version", error))?.unwrap_or(vk::API_VERSION_1_0);
        // Not lowered to what the maker was tested with: wgpu uses all that a device of this version has.
        let version = available.min(NEWEST_API_VERSION);
        let flags = wgpu::InstanceFlags::empty();
        let extensions = hal::vulkan::Instance::desired_extensions(&loader, version, flags)
            .map_err(|error| refused("extensions of the Vulkan instance", error))?;

        let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default().application_name(c"steradian").api_version(version);
        let info = vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&names);
        let raw_instance = maker.instance(&loader, &info)?;
        // SAFETY: the maker has made it through this loader.
        let instance = unsafe { ash::Instance::load(loader.static_fn(), raw_instance) };
        // SAFETY: made from `loader` with this version and these extensions; without a callback it is destroyed with the
        // last that uses it, and by nobody else.
        let hal_instance = unsafe {
            hal::vulkan::Instance::from_raw(
                loader.clone(),
                instance.clone(),
                version,
                0,
                None,
                extensions,
                flags,
                wgpu::MemoryBudgetThresholds::default(),
                false,
                None,
            )
        }
        .map_err(|error| refused("the Vulkan instance", error))?;

        let physical_device = maker.physical_device(raw_instance)?;
        let exposed = hal_instance
            .expose_adapter(physical_device)
            .ok_or_else(|| GpuError::Adopt("the adapter of the headset does not do what is needed".to_owned()))?;
        // SAFETY: the adapter was exposed by this instance, which is a valid one.
        let adapter =
            unsafe { wgpu::Instance::from_hal::<Vulkan>(hal_instance).create_adapter_from_hal::<Vulkan>(exposed) };
        let selection = Selection::of(&adapter, options);
        let descriptor = selection.descriptor();

        // SAFETY: the physical device is one of this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
        let draws = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = families.iter().position(|family| family.queue_flags.contains(draws));
        let family = family.ok_or_else(|| GpuError::Adopt("the adapter has no queue that draws".to_owned()))? as u32;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];

        let open = {
            // SAFETY: the guard's adapter is only asked and used to wrap the device.
            let hal_adapter = unsafe { adapter.as_hal::<Vulkan>() };
            let hal_adapter = hal_adapter.ok_or_else(|| GpuError::Adopt("the adapter is not Vulkan's".to_owned()))?;
            let extensions: Vec<&'static CStr> = hal_adapter.required_device_extensions(selection.features);
            let mut features = hal_adapter.physical_device_features(&extensions, selection.features);
            let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names);
            let raw_device = maker.device(&loader, physical_device, &features.add_to_device_create(info))?;
            // SAFETY: the maker has made it of a physical device of this instance.
            let device = unsafe { ash::Device::load(instance.fp_v1_0(), raw_device) };
            let unused = device.clone();
            // SAFETY: made from this adapter with these extensions and features and a queue of this family; without a
            // callback it is destroyed with the last that uses it, and by nobody else.
            unsafe {
                hal_adapter.device_from_raw(
                    device,
                    None,
                    &extensions,
                    selection.features,
                    &selection.limits,
                    &descriptor.memory_hints,
                    family,
                    0,
                )
            }
            .map_err(|error| {
                // SAFETY: nobody has taken the device, and nothing was made with it that is not gone.
                unsafe { unused.destroy_device(None) };
                refused("the Vulkan device", error)
            })?
        };
        let raw_device = open.device.raw_device().handle();
        // SAFETY: the device was opened from this adapter, with the features of the descriptor.
        let opened = unsafe { adapter.create_device_from_hal(open, &descriptor) };
        let info = adapter.get_info();
        let (device, queue) = opened.map_err(|source| GpuError::Device { adapter: info.name.clone(), source })?;
        let handles = VulkanHandles {
            instance: raw_instance.as_raw(),
            physical_device: physical_device.as_raw(),
            device: raw_device.as_raw(),
            queue_family_index: family,
            queue_index: 0,
        };
        Ok((Self::assemble(info, device, queue, selection, options), handles))
    }

    /// Wraps an image that somebody else owns, such as one of a headset's swapchain.
    ///
    /// # Safety
    ///
    /// `image` must be one of this device, made as `descriptor` says, in the layout of colour attachments whenever it is
    /// drawn to, and must outlive the texture and the work that was submitted with it.
    pub unsafe fn adopt_image(
        &self,
        image: u64,
        descriptor: &wgpu::TextureDescriptor<'_>,
    ) -> Option<wgpu::Texture> {
        let hal_descriptor = hal::TextureDescriptor {
            label: descriptor.label,
            size: descriptor.size,
            mip_level_count: descriptor.mip_level_count,
            sample_count: descriptor.sample_count,
            dimension: descriptor.dimension,
            format: descriptor.format,
            usage: wgpu::TextureUses::COLOR_TARGET | wgpu::TextureUses::COPY_SRC,
            memory_flags: hal::MemoryFlags::empty(),
            view_formats: Vec::new(),
        };
        // SAFETY: the guard's device only wraps the image; the caller promises that it is of this device and made so. The
        // callback does nothing: whoever owns the image destroys it.
        let texture = unsafe {
            let device = self.device.as_hal::<Vulkan>()?;
            let memory = hal::vulkan::TextureMemory::External;
            device.texture_from_raw(vk::Image::from_raw(image), &hal_descriptor, Some(Box::new(|| {})), memory)
        };
        // SAFETY: made from this device's handle just now, and the caller promises the layout.
        Some(unsafe {
            self.device.create_texture_from_hal::<Vulkan>(texture, descriptor, wgpu::TextureUses::COLOR_TARGET)
        })
    }
}
