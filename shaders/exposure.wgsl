// The exposure pass: one workgroup sums the partial sums of illuminance of all tiles, in an order that never changes, and
// chooses one exposure for all views. The mean luminance is sum(L Omega) / sum(Omega). The f64 twin is
// src/photometry/exposure.rs. Needs shared/exposure.wgsl.

struct ExposureParameters {
    // Solid angle of all pixels of the rig, sr.
    total_solid_angle_sr: f32,
    min_ev100: f32,
    max_ev100: f32,
    compensation_ev: f32,
    // The exposure to use instead of the metered one, if `fixed` is 1.
    fixed_ev100: f32,
    fixed: u32,
    partial_count: u32,
    unused_0: u32,
}

@group(0) @binding(0) var<uniform> parameters: ExposureParameters;
@group(0) @binding(1) var<storage, read> partial_sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> exposure: Exposure;

const THREADS: u32 = 256u;
var<workgroup> sums: array<f32, THREADS>;

@compute @workgroup_size(THREADS)
fn choose_exposure(@builtin(local_invocation_index) local: u32) {
    // Compensated (Kahan) summation: a 4K frame has a hundred thousand partial sums.
    var sum = 0.0;
    var lost = 0.0;
    for (var i = local; i < parameters.partial_count; i += THREADS) {
        let value = partial_sums[i];
        // One pixel that is not finite must not take the frame with it.
        if !(value < 3e38) {
            continue;
        }
        let term = value - lost;
        let next = sum + term;
        lost = (next - sum) - term;
        sum = next;
    }
    sums[local] = sum;
    for (var stride = THREADS / 2u; stride > 0u; stride /= 2u) {
        workgroupBarrier();
        if local < stride {
            sums[local] += sums[local + stride];
        }
    }
    if local == 0u {
        let mean = sums[0] / parameters.total_solid_angle_sr;
        // ISO 2720 with the calibration constant 12.5: ev100 = log2(100 L / 12.5). Darkness gives the lowest exposure.
        var metered = parameters.min_ev100;
        if mean > 0.0 {
            metered = clamp(log2(mean * 8.0) + parameters.compensation_ev, parameters.min_ev100, parameters.max_ev100);
        }
        let ev100 = select(metered, parameters.fixed_ev100, parameters.fixed != 0u);
        exposure.ev100 = ev100;
        exposure.metered_ev100 = metered;
        exposure.mean_luminance_cd_m2 = mean;
        exposure.display_per_cd_m2 = exp2(-ev100) / 1.2;
    }
}
