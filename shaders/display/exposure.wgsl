// The exposure pass: one workgroup sums the partial sums of illuminance of all tiles in a fixed order, and computes one
// exposure for all views. The mean luminance is sum(L Omega) / sum(Omega) over the pixels with finite light. The f64
// twin is crates/sky/src/photometry/exposure.rs.

#import structs/Exposure
#import structs/ExposureParameters

@group(0) @binding(0) var<uniform> parameters: ExposureParameters;
// Metered illuminance, and solid angle excluded from metering.
@group(0) @binding(1) var<storage, read> partial_sums: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> exposure: Exposure;

const EXPOSURE_THREADS: u32 = 256u;
var<workgroup> sums: array<vec2<f32>, EXPOSURE_THREADS>;

@compute @workgroup_size(EXPOSURE_THREADS)
fn choose_exposure(@builtin(local_invocation_index) local: u32) {
    // Compensated (Kahan) summation: a 4K frame has a hundred thousand partial sums.
    var sum = 0.0;
    var rounded = 0.0;
    var left_out = 0.0;
    for (var i = local; i < parameters.partial_count; i += EXPOSURE_THREADS) {
        let partial = partial_sums[i];
        left_out += partial.y;
        // A non-finite sum, even one of finite pixels, must not spoil the frame.
        let counts = (bitcast<u32>(partial.x) & 0x7f800000u) != 0x7f800000u;
        let term = select(0.0, partial.x, counts) - rounded;
        let next = sum + term;
        rounded = (next - sum) - term;
        sum = next;
    }
    sums[local] = vec2(sum, left_out);
    for (var stride = EXPOSURE_THREADS / 2u; stride > 0u; stride /= 2u) {
        workgroupBarrier();
        if local < stride {
            sums[local] += sums[local + stride];
        }
    }
    if local == 0u {
        // Pixels excluded from the light are also excluded from the solid angle.
        let counted = parameters.total_solid_angle_sr - sums[0].y;
        var mean = 0.0;
        if counted > 0.0 {
            mean = min(sums[0].x / counted, 3e38);
        }
        // ISO 2720 with the calibration constant 12.5: ev100 = log2(100 L / 12.5). Darkness gives the lowest exposure.
        var metered = parameters.min_ev100;
        if mean > 0.0 {
            metered = clamp(log2(mean * 8.0) + parameters.offset_ev, parameters.min_ev100, parameters.max_ev100);
        }
        let ev100 = select(metered, parameters.fixed_ev100, parameters.fixed != 0u);
        exposure.ev100 = ev100;
        exposure.metered_ev100 = metered;
        exposure.mean_luminance_cd_m2 = mean;
        exposure.display_per_cd_m2 = exp2(-ev100) / 1.2;
    }
}
