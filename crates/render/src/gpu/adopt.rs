//! Wraps a Vulkan device that an OpenXR runtime created, and images of its swapchains.
//!
//! This is the only file of the module with unsafe code. Each block says why it is sound.
#![expect(unsafe_code, reason = "the runtime of a headset supplies handles of Vulkan")]

use std::ffi::CStr;

use ash::vk::{self, Handle};
use wgpu::hal::{self, api::Vulkan};

use super::{
    Gpu, GpuError, GpuOptions,
    adapter::{Selection, Skipped},
};

/// Newest version of Vulkan that is requested: the one that wgpu itself requests.
pub const NEWEST_API_VERSION: u32 = vk::API_VERSION_1_3;

/// Creates the instance and the device of Vulkan.
///
/// # Safety
///
/// The methods must create their results from their arguments: the instance with the loader's function and at least the extensions in
/// `info`, the physical device from that instance, and the device from that physical device with at least the extensions, features and
/// queues in `info`. No other code may destroy them.
pub unsafe trait DeviceMaker {
    type Error: From<GpuError>;

    fn instance(&self, loader: &ash::Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<vk::Instance, Self::Error>;

    /// Selects the physical device.
    fn physical_device(&self, instance: vk::Instance) -> Result<vk::PhysicalDevice, Self::Error>;

    fn device(
        &self,
        loader: &ash::Entry,
        physical_device: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device, Self::Error>;
}

/// Raw handles of an adopted device, for the code that created it. They are valid as long as the [`Gpu`] exists.
#[derive(Clone, Copy, Debug)]
pub struct VulkanHandles {
    pub instance: u64,
    pub physical_device: u64,
    pub device: u64,
    pub queue_family_index: u32,
    pub queue_index: u32,
}

fn refused(part: &str, error: impl std::fmt::Display) -> GpuError {
    GpuError::Adopt(format!("{part}: {error}"))
}

impl Gpu {
    /// Opens the device that `maker` creates.
    ///
    /// # Errors
    ///
    /// `maker` fails, or the device cannot be used.
    pub fn adopt<M: DeviceMaker>(maker: &M, options: &GpuOptions) -> Result<(Self, VulkanHandles), M::Error> {
        // SAFETY: the loader is the system's Vulkan library, which implements Vulkan's interface.
        let loader = unsafe { ash::Entry::load() }.map_err(|error| refused("no Vulkan loader", error))?;
        // SAFETY: the loader was loaded just now.
        let available = unsafe { loader.try_enumerate_instance_version() };
        let available = available.map_err(|error| refused("Vulkan's version", error))?.unwrap_or(vk::API_VERSION_1_0);
        // Do not limit this to the version that the runtime was tested with: wgpu uses all functions of the device's version.
        let version = available.min(NEWEST_API_VERSION);
        let flags = wgpu::InstanceFlags::empty();
        let extensions = hal::vulkan::Instance::desired_extensions(&loader, version, flags)
            .map_err(|error| refused("extensions of the Vulkan instance", error))?;

        let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default().application_name(c"steradian").api_version(version);
        let info = vk::InstanceCreateInfo::default().application_info(&application).enabled_extension_names(&names);
        let raw_instance = maker.instance(&loader, &info)?;
        // SAFETY: the maker created it with this loader.
        let instance = unsafe { ash::Instance::load(loader.static_fn(), raw_instance) };
        // SAFETY: created from `loader` with this version and these extensions. Without a callback wgpu destroys it after its last use,
        // and no other code does.
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
            .ok_or_else(|| GpuError::Adopt("the adapter of the headset lacks required features".to_owned()))?;
        // SAFETY: this instance, which is valid, exposed the adapter.
        let adapter =
            unsafe { wgpu::Instance::from_hal::<Vulkan>(hal_instance).create_adapter_from_hal::<Vulkan>(exposed) };
        let selection = Selection::new(&adapter, options)
            .map_err(|lacks| GpuError::Unusable(vec![Skipped { adapter: adapter.get_info().name, lacks }]))?;
        let descriptor = selection.descriptor();

        // SAFETY: the physical device belongs to this instance.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical_device) };
        let draws = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
        let family = families.iter().position(|family| family.queue_flags.contains(draws));
        let family = family
            .ok_or_else(|| GpuError::Adopt("the adapter has no queue for graphics and compute".to_owned()))?
            as u32;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];

        let open = {
            // SAFETY: the guard's adapter is only queried and used to wrap the device.
            let hal_adapter = unsafe { adapter.as_hal::<Vulkan>() };
            let hal_adapter = hal_adapter.ok_or_else(|| GpuError::Adopt("the adapter is not Vulkan's".to_owned()))?;
            let extensions: Vec<&'static CStr> = hal_adapter.required_device_extensions(selection.features);
            let mut features = hal_adapter.physical_device_features(&extensions, selection.features);
            let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names);
            let raw_device = maker.device(&loader, physical_device, &features.add_to_device_create(info))?;
            // SAFETY: the maker created it from a physical device of this instance.
            let device = unsafe { ash::Device::load(instance.fp_v1_0(), raw_device) };
            let unused = device.clone();
            // SAFETY: created from this adapter with these extensions and features and a queue of this family. Without a callback wgpu
            // destroys it after its last use, and no other code does.
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
                // SAFETY: no other code holds the device, and everything that was created with it is destroyed.
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

    /// Wraps an image that other code owns, such as one of a headset's swapchain.
    ///
    /// # Safety
    ///
    /// `image` must belong to this device, match `descriptor`, be in the layout of colour attachments whenever it is drawn to, and outlive
    /// the texture and the work submitted with it.
    pub unsafe fn adopt_image(&self, image: u64, descriptor: &wgpu::TextureDescriptor<'_>) -> Option<wgpu::Texture> {
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
        // SAFETY: the guard's device only wraps the image; the caller guarantees that it belongs to this device and matches the
        // descriptor. The callback does nothing: the owner of the image destroys it.
        let texture = unsafe {
            let device = self.device.as_hal::<Vulkan>()?;
            let memory = hal::vulkan::TextureMemory::External;
            device.texture_from_raw(vk::Image::from_raw(image), &hal_descriptor, Some(Box::new(|| {})), memory)
        };
        // SAFETY: created from this device's handle above, and the caller guarantees the layout.
        Some(unsafe {
            self.device.create_texture_from_hal::<Vulkan>(texture, descriptor, wgpu::TextureUses::COLOR_TARGET)
        })
    }
}
