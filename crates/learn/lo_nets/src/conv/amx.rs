//! bf16 matrix products on Intel's AMX units (cargo feature `amx`), with a portable fallback.
//!
//! bf16 is the upper half of an `f32`, rounded to nearest. Products are exact; sums are `f32`.

use std::sync::LazyLock;

/// Rows and columns of the block computed by [`BlockProduct::block`].
pub const BLOCK: usize = 32;

/// Products that are summed in each step of a block.
pub const STEP: usize = 32;

/// Rows of an AMX tile register, and pairs of numbers in one of its rows.
const TILE: usize = 16;

/// Converts to bf16, rounding to nearest, ties to even. NaN stays NaN.
#[inline(always)]
pub fn bf16(value: f32) -> u16 {
    let bits = value.to_bits();
    let rounded = bits.wrapping_add(0x7fff + ((bits >> 16) & 1)) >> 16;
    (if value.is_nan() { 0x7fc0 } else { rounded }) as u16
}

/// Packs two bf16 numbers, the first in the lower half.
#[inline(always)]
pub fn bf16_pair(first: f32, second: f32) -> u32 {
    u32::from(bf16(first)) | u32::from(bf16(second)) << 16
}

/// A sum of products of two sequences of matrices.
#[derive(Clone, Copy, Debug)]
pub struct BlockProduct<'a> {
    /// Left matrices as bf16 numbers: `BLOCK` rows of `STEP` numbers for each step.
    pub left: &'a [u16],
    /// Offsets of rows 0 and 16 in the first step.
    pub halves: [usize; 2],
    /// Distance, in numbers, between the rows of a half.
    pub left_stride: usize,
    /// Distance, in numbers, between steps.
    pub left_step: usize,
    /// Right matrices as pairs of bf16 numbers ([`bf16_pair`]): `STEP / 2` rows of `BLOCK` pairs for each step. A pair
    /// holds two consecutive rows of a column.
    pub right: &'a [u32],
    /// Offset of each step's first row. Its length is the number of steps.
    pub offsets: &'a [usize],
    /// Added to all offsets.
    pub first: usize,
    /// Distance, in pairs, between rows.
    pub right_stride: usize,
}

impl BlockProduct<'_> {
    /// Computes the sum over all steps of left times right.
    ///
    /// # Panics
    /// Where a step exceeds the slices.
    #[allow(unsafe_code)]
    pub fn block(&self, out: &mut [[f32; BLOCK]; BLOCK]) {
        let Some(last) = self.offsets.iter().max() else {
            *out = [[0.0; BLOCK]; BLOCK];
            return;
        };
        let steps = self.offsets.len();
        let left = self.halves[0].max(self.halves[1]) + (TILE - 1) * self.left_stride + (steps - 1) * self.left_step;
        assert!(left + STEP <= self.left.len(), "a step exceeds the left operand");
        let right = last + self.first + (TILE - 1) * self.right_stride;
        assert!(right + BLOCK <= self.right.len(), "a step exceeds the right operand");
        #[cfg(all(feature = "training", target_arch = "x86_64", target_os = "linux"))]
        if available() {
            // SAFETY: processor and operating system support AMX; the assertions above keep all reads within the
            // slices.
            unsafe { self.amx_block(out) };
            return;
        }
        self.portable_block(out);
    }

    /// Computes the block without AMX. Results differ by the order of sums alone.
    fn portable_block(&self, out: &mut [[f32; BLOCK]; BLOCK]) {
        *out = [[0.0; BLOCK]; BLOCK];
        let value = |half: u16| f32::from_bits(u32::from(half) << 16);
        for (step, offset) in self.offsets.iter().enumerate() {
            for (i, out) in out.iter_mut().enumerate() {
                let left = self.halves[i / TILE] + i % TILE * self.left_stride + step * self.left_step;
                for (k, left) in self.left[left..][..STEP].chunks_exact(2).enumerate() {
                    let right = &self.right[offset + self.first + k * self.right_stride..][..BLOCK];
                    for (out, &pair) in out.iter_mut().zip(right) {
                        *out += value(left[0]) * value(pair as u16) + value(left[1]) * value((pair >> 16) as u16);
                    }
                }
            }
        }
    }

    /// # Safety
    /// AMX is [`available`], there is at least one step, and no step exceeds the slices.
    #[cfg(all(feature = "training", target_arch = "x86_64", target_os = "linux"))]
    #[allow(unsafe_code)]
    unsafe fn amx_block(&self, out: &mut [[f32; BLOCK]; BLOCK]) {
        let [a, b] = self.halves.map(|start| self.left[start..].as_ptr());
        // SAFETY: the function's contract keeps reads within the slices; writes go to `out`. Tiles are configured, used
        // and released within this block.
        unsafe {
            std::arch::asm!(
                "ldtilecfg [{place}]",
                "tilezero tmm0",
                "tilezero tmm1",
                "tilezero tmm2",
                "tilezero tmm3",
                "2:",
                "mov {place}, [{offsets}]",
                "lea {place}, [{right} + 4*{place}]",
                "tileloadd tmm4, [{a} + 1*{left_stride}]",
                "tileloadd tmm6, [{place} + 1*{right_stride}]",
                "tileloadd tmm7, [{place} + 1*{right_stride} + 64]",
                "tdpbf16ps tmm0, tmm4, tmm6",
                "tdpbf16ps tmm1, tmm4, tmm7",
                "tileloadd tmm5, [{b} + 1*{left_stride}]",
                "tdpbf16ps tmm2, tmm5, tmm6",
                "tdpbf16ps tmm3, tmm5, tmm7",
                "add {a}, {left_step}",
                "add {b}, {left_step}",
                "add {offsets}, 8",
                "dec {steps}",
                "jnz 2b",
                "mov {place}, 128",
                "tilestored [{out} + 1*{place}], tmm0",
                "tilestored [{out} + 1*{place} + 64], tmm1",
                "tilestored [{out} + 1*{place} + 2048], tmm2",
                "tilestored [{out} + 1*{place} + 2112], tmm3",
                "tilerelease",
                place = inout(reg) &TILE_CONFIG => _,
                a = inout(reg) a => _,
                b = inout(reg) b => _,
                left_stride = in(reg) 2 * self.left_stride,
                left_step = in(reg) 2 * self.left_step,
                right = in(reg) self.right.as_ptr().add(self.first),
                right_stride = in(reg) 4 * self.right_stride,
                offsets = inout(reg) self.offsets.as_ptr() => _,
                steps = inout(reg) self.offsets.len() => _,
                out = in(reg) out.as_mut_ptr(),
                out("tmm0") _, out("tmm1") _, out("tmm2") _, out("tmm3") _,
                out("tmm4") _, out("tmm5") _, out("tmm6") _, out("tmm7") _,
                options(nostack),
            );
        }
    }
}

/// Configures eight tiles of 16 rows of 64 bytes (Intel's manual, volume 1, 18.3).
#[cfg(all(feature = "training", target_arch = "x86_64", target_os = "linux"))]
static TILE_CONFIG: TileConfig = {
    let mut bytes = [0; 64];
    bytes[0] = 1;
    let mut tile = 0;
    while tile < 8 {
        bytes[16 + 2 * tile] = 64;
        bytes[48 + tile] = TILE as u8;
        tile += 1;
    }
    TileConfig(bytes)
};

#[cfg(all(feature = "training", target_arch = "x86_64", target_os = "linux"))]
#[repr(C, align(64))]
struct TileConfig([u8; 64]);

/// Reports whether the processor has AMX, the system permits its use, and the feature `amx` is compiled in.
pub fn available() -> bool {
    static AVAILABLE: LazyLock<bool> = LazyLock::new(detect);
    *AVAILABLE
}

#[cfg(not(all(feature = "training", target_arch = "x86_64", target_os = "linux")))]
fn detect() -> bool {
    false
}

#[cfg(all(feature = "training", target_arch = "x86_64", target_os = "linux"))]
#[allow(unsafe_code)]
fn detect() -> bool {
    use std::arch::x86_64::{__cpuid, __cpuid_count};
    // CPUID bits of AMX-BF16 and AMX-TILE.
    const UNIT: u32 = 1 << 22 | 1 << 24;
    const ARCH_PRCTL: i64 = 158;
    const ARCH_REQ_XCOMP_PERM: i64 = 0x1023;
    const TILE_DATA: i64 = 18;
    if __cpuid(0).eax < 7 || __cpuid_count(7, 0).edx & UNIT != UNIT {
        return false;
    }
    let answer: i64;
    // SAFETY: the system call requests permission for tile data and touches no memory. Linux before 5.16 refuses it.
    unsafe {
        std::arch::asm!(
            "syscall",
            inlateout("rax") ARCH_PRCTL => answer,
            in("rdi") ARCH_REQ_XCOMP_PERM,
            in("rsi") TILE_DATA,
            lateout("rcx") _,
            lateout("r11") _,
            options(nostack),
        );
    }
    answer == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::values;

    #[test]
    fn bf16_is_the_nearest() {
        for (value, expected) in [
            (0.0, 0.0),
            (-1.0, -1.0),
            (1.0 + 1.0 / 128.0, 1.0 + 1.0 / 128.0),
            (1.0 + 1.0 / 256.0, 1.0),
            (1.0 + 3.0 / 256.0, 1.0 + 1.0 / 64.0),
            (f32::INFINITY, f32::INFINITY),
            (f32::MAX, f32::INFINITY),
            (2f32.powi(-131), 2f32.powi(-131)),
        ] {
            let got = f32::from_bits(u32::from(bf16(value)) << 16);
            assert!(got.to_bits() == expected.to_bits(), "{value}: {got}");
        }
        for bits in [0x7fc0_0000, 0x7fff_ffff, 0xffff_ffff, 0x7f80_0001] {
            assert!(f32::from_bits(u32::from(bf16(f32::from_bits(bits))) << 16).is_nan());
        }
        assert_eq!(bf16_pair(1.0, -2.0), 0xc000_3f80);
    }

    #[test]
    fn amx_equals_portable_code() {
        let numbers = values(6000, 1);
        let left: Vec<u16> = numbers.iter().map(|&v| bf16(v as f32)).collect();
        let right: Vec<u32> = numbers.chunks_exact(2).map(|v| bf16_pair(v[0] as f32, v[1] as f32)).collect();
        for offsets in [&[0][..], &[7, 3, 901], &[]] {
            let product = BlockProduct {
                left: &left,
                halves: [5, 2500],
                left_stride: 71,
                left_step: 33,
                right: &right,
                offsets,
                first: 11,
                right_stride: 40,
            };
            let [mut got, mut expected] = [[[7.0; BLOCK]; BLOCK]; 2];
            product.block(&mut got);
            product.portable_block(&mut expected);
            for (got, expected) in got.as_flattened().iter().zip(expected.as_flattened()) {
                assert!((got - expected).abs() <= 1e-4, "{got} {expected}");
            }
            // One of the sums, in f64.
            let value = |half: u16| f64::from(f32::from_bits(u32::from(half) << 16));
            let mut sum = 0.0;
            for (step, offset) in offsets.iter().enumerate() {
                for k in 0..STEP {
                    let pair = right[offset + 11 + k / 2 * 40 + 9];
                    let half = if k % 2 == 0 { pair as u16 } else { (pair >> 16) as u16 };
                    sum += value(left[2500 + 3 * 71 + step * 33 + k]) * value(half);
                }
            }
            assert!((f64::from(got[19][9]) - sum).abs() <= 1e-4, "{} {sum}", got[19][9]);
        }
    }

    #[test]
    #[should_panic(expected = "exceeds the right operand")]
    fn steps_outside_of_the_operands_panic() {
        let product = BlockProduct {
            left: &[0; 2048],
            halves: [0, 512],
            left_stride: 32,
            left_step: 0,
            right: &[0; 15 * 40 + 31],
            offsets: &[0],
            first: 0,
            right_stride: 40,
        };
        product.block(&mut [[0.0; BLOCK]; BLOCK]);
    }
}
