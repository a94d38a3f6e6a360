//! Transfer of textures to the host.

use half::f16;

use super::{Gpu, GpuError};

/// Returns the bytes of a layer of a texture with one level, row by row from the top, without the padding of copies. Waits for all
/// submitted work. The texture must have the usage `COPY_SRC`.
pub fn read_layer(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>, GpuError> {
    let format = texture.format();
    let texel_bytes = format
        .block_copy_size(None)
        .ok_or_else(|| GpuError::Refused(format!("textures of format {format:?} cannot be read back")))?;
    let row_bytes = texture.width() * texel_bytes;
    let padded_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = gpu.create_buffer(&wgpu::BufferDescriptor {
        label: Some("texels"),
        size: u64::from(padded_bytes) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("texels") });
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo { origin: wgpu::Origin3d { x: 0, y: 0, z: layer }, ..texture.as_image_copy() },
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded_bytes), rows_per_image: None },
        },
        wgpu::Extent3d { depth_or_array_layers: 1, ..texture.size() },
    );
    gpu.queue.submit([encoder.finish()]);
    // `get_mapped_range` returns an error if mapping fails.
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    let waited = gpu.wait(None);
    // The driver's error explains more than that of the failed wait.
    gpu.take_failure()?;
    waited?;
    let bytes = buffer.get_mapped_range(..)?;
    let rows = bytes.chunks_exact(padded_bytes as usize);
    Ok(rows.flat_map(|row| &row[..row_bytes as usize]).copied().collect())
}

/// Converts the bytes that [`read_layer`] returned to texels, which have four 16-bit floats each.
pub fn texels_of_halves(bytes: &[u8]) -> Vec<[f32; 4]> {
    let (texels, _) = bytes.as_chunks::<8>();
    let half = |texel: &[u8; 8], first: usize| f16::from_le_bytes([texel[first], texel[first + 1]]).to_f32();
    texels.iter().map(|texel| [0, 2, 4, 6].map(|first| half(texel, first))).collect()
}
