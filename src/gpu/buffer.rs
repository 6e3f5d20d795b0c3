//! A buffer with its memory.

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::context::{Context, OrVulkan};
use crate::error::{Error, Remedy, Result};
use crate::text;

pub(super) struct Buffer {
    pub handle: vk::Buffer,
    pub bytes: u64,
    /// The buffer as texels of four u32, if a stage reads it so.
    texels: Option<vk::BufferView>,
    allocation: Option<Allocation>,
}

impl Buffer {
    pub fn new(context: &Context, name: &str, bytes: u64, location: MemoryLocation) -> Result<Self> {
        let usage = match location {
            MemoryLocation::GpuOnly => {
                vk::BufferUsageFlags::STORAGE_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_BUFFER
                    | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
                    | vk::BufferUsageFlags::TRANSFER_SRC
                    | vk::BufferUsageFlags::TRANSFER_DST
            }
            _ => vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST,
        };
        Self::with_usage(context, name, bytes, location, usage)
    }

    pub fn with_usage(
        context: &Context,
        name: &str,
        bytes: u64,
        location: MemoryLocation,
        usage: vk::BufferUsageFlags,
    ) -> Result<Self> {
        let create = vk::BufferCreateInfo::default().size(bytes.max(4)).usage(usage);
        // SAFETY: the context outlives the buffer: Device frees its buffers before the context.
        unsafe {
            let handle = context
                .device
                .create_buffer(&create, None)
                .or_vulkan("vkCreateBuffer")?;
            let requirements = context.device.get_buffer_memory_requirements(handle);
            let allocation = context
                .allocator
                .lock()
                .map_err(|_| Error::Device("the allocator's lock is poisoned".to_owned()))?
                .allocate(&AllocationCreateDesc {
                    name,
                    requirements,
                    location,
                    linear: true,
                    allocation_scheme: AllocationScheme::GpuAllocatorManaged,
                })
                .map_err(|error| {
                    context.device.destroy_buffer(handle, None);
                    let what = format!(
                        "no memory for {name}, {} beside what there is already: {error}",
                        text::bytes(bytes.max(4))
                    );
                    Error::unfit(what, Remedy::SmallerRender)
                })?;
            context
                .device
                .bind_buffer_memory(handle, allocation.memory(), allocation.offset())
                .or_vulkan("vkBindBufferMemory")?;
            context.name(handle, name);
            Ok(Self {
                handle,
                bytes: bytes.max(4),
                texels: None,
                allocation: Some(allocation),
            })
        }
    }

    /// The view for texel reads, created at its first use.
    pub fn texels(&mut self, context: &Context) -> Result<vk::BufferView> {
        if let Some(view) = self.texels {
            return Ok(view);
        }
        let create = vk::BufferViewCreateInfo::default()
            .buffer(self.handle)
            .format(vk::Format::R32G32B32A32_UINT)
            .range(vk::WHOLE_SIZE);
        // SAFETY: the buffer is alive; `free` destroys the view before it.
        let view = unsafe { context.device.create_buffer_view(&create, None) }.or_vulkan("vkCreateBufferView")?;
        self.texels = Some(view);
        Ok(view)
    }

    /// The memory of a host-visible buffer.
    pub fn mapped(&mut self) -> &mut [u8] {
        self.allocation
            .as_mut()
            .and_then(Allocation::mapped_slice_mut)
            .unwrap_or_default()
    }

    /// Frees the buffer. The device must not be using it.
    pub fn free(mut self, context: &Context) {
        // SAFETY: the caller has waited for the work that used it.
        unsafe {
            if let Some(view) = self.texels {
                context.device.destroy_buffer_view(view, None);
            }
            context.device.destroy_buffer(self.handle, None);
        }
        if let (Some(allocation), Ok(mut allocator)) = (self.allocation.take(), context.allocator.lock()) {
            // This fails only for an allocation of another allocator.
            let _ = allocator.free(allocation);
        }
    }
}
