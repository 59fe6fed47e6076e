//! Bias of a gyro from its temperature: bindings of the gyrotc C runtime, `no_std`, without heap.
//!
//! `gyrotc emit` writes a table for each axis of each gyro as C source; the firmware's own build script compiles it
//! beside this crate (`example/build.rs`). The functions keep their names, meanings and costs: the manual is `gtc.h`.
//! [`float32`] computes in float32, [`q31`] in fixed point; both give the same bits as the C functions, for they are
//! the C functions.
//!
//! The sizes of a state follow from the options of `gtc_config.h`. These bindings are those of the defaults; a runtime
//! that was compiled with others does not link, because its names end otherwise.
#![no_std]
#![warn(clippy::pedantic)]

/// One 32-bit word of an image, of a table or of a saved state.
pub type Word = u32;

/// Words of a saved state, `GTC_SAVE_WORDS`.
pub const SAVE_WORDS: usize = 40 + MAX_SLOPE_BLOCKS + 16 * MAX_TERMS;

const MAX_SLOPE_BLOCKS: usize = 20;
const MAX_TERMS: usize = 4;

/// Remarks about a correction that is to be subtracted, one bit each. No bit: nothing to remark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Remarks(pub u32);

impl Remarks {
    /// Slope and mean are not full yet; slope taken as 0.
    pub const WARMING: Self = Self(1);
    /// A channel outside its range, or a correction outside the authority: the edge.
    pub const CLAMPED: Self = Self(2);
    /// Inside the envelope, but no training data near.
    pub const UNCOVERED: Self = Self(4);
    /// Sample or block missing, stuck, impossible or not confirmed yet: last correction kept.
    pub const HELD: Self = Self(8);
    /// Temperature held too long: the table's constant correction.
    pub const FALLBACK: Self = Self(16);
    /// An auxiliary channel held too long: the guard's value stands for it.
    pub const CHANNEL_LOST: Self = Self(32);

    /// Whether every bit of `other` is set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// Why nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Not a number, a count or a size out of range, another number of channels than the table has.
    Argument,
    /// A table of another layout, or one that needs what was not compiled in.
    Layout,
    /// Arithmetic or a known answer wrong: do not navigate with this build.
    SelfTest,
    /// Image or saved state corrupted, truncated or torn.
    Image,
    /// Image or saved state of another table.
    Id,
    /// No whole number of samples of this period makes a block of the table.
    Period,
    /// The table does not hold what the call needs: uncertainties, or a re-zero.
    Absent,
    /// A re-zero beyond 4 sigma of what is known: the vehicle moved, or Earth's rate is in it.
    Rest,
    /// A status of a later runtime.
    Unknown(i32),
}

fn done(status: core::ffi::c_int) -> Result<Remarks, Error> {
    match status {
        -1 => Err(Error::Argument),
        -2 => Err(Error::Layout),
        -3 => Err(Error::SelfTest),
        -4 => Err(Error::Image),
        -5 => Err(Error::Id),
        -6 => Err(Error::Period),
        -7 => Err(Error::Absent),
        -8 => Err(Error::Rest),
        other => u32::try_from(other).map(Remarks).map_err(|_| Error::Unknown(other)),
    }
}

macro_rules! arithmetic {
    (
        $(#[$text:meta])* $module:ident, number $number:ty, age $seconds:ty, interval $interval:ty,
        state words $words:literal, input $input:ty, inputs $inputs:expr, angle $rest:ty,
        $check:literal $open:literal $init:literal $sample:literal
        $bias:literal $snapshot:literal $rezero:literal $save:literal $restore:literal $angle:literal
    ) => {
        $(#[$text])*
        pub mod $module {
            use crate::{done, Error, Remarks, Word, MAX_TERMS, SAVE_WORDS};
            use core::ffi::{c_int, c_void};
            use core::marker::PhantomData;
            use core::ptr;

            /// A table: constant data that an emitted C file holds, or an image that was opened.
            #[repr(C)]
            pub struct Table {
                head: [Word; 33],
                arrays: [*const Word; 8],
                crc: Word,
                term_code: *const c_void,
            }

            // A table is read only, by any number of threads and interrupts.
            unsafe impl Sync for Table {}
            unsafe impl Send for Table {}

            #[repr(C)]
            #[derive(Clone)]
            struct Raw {
                table: *const Table,
                words: [Word; $words],
                inputs: [$input; $inputs],
            }

            /// A correction with its uncertainty, all of one moment.
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq)]
            pub struct Snapshot {
                /// The correction in force, in the unit of the arithmetic.
                pub bias: $number,
                /// One sigma of (true bias - bias), in the same unit.
                pub sigma: $number,
                /// Correlation time of that error in seconds.
                pub correlation_s: $seconds,
                /// Blocks since the last valid one.
                pub age_blocks: u32,
                status: i32,
            }

            #[repr(C)]
            #[derive(Clone, Default)]
            struct RawAngle {
                rest: $rest,
            }

            extern "C" {
                #[link_name = $check]
                fn check(table: *const Table) -> c_int;
                #[link_name = $open]
                fn open(table: *mut Table, words: *const Word, n_words: u32, id: u32) -> c_int;
                #[link_name = $init]
                fn init(state: *mut Raw, table: *const Table, period_us: u32) -> c_int;
                #[link_name = $sample]
                fn sample(state: *mut Raw, elapsed_us: u32, channels: *const $number) -> c_int;
                #[link_name = $bias]
                fn bias(state: *const Raw, bias: *mut $number) -> c_int;
                #[link_name = $snapshot]
                fn snapshot(state: *const Raw, snapshot: *mut Snapshot) -> c_int;
                #[link_name = $rezero]
                fn rezero(state: *mut Raw, mean_rate: $number, seconds: u32) -> c_int;
                #[link_name = $save]
                fn save(state: *const Raw, words: *mut Word) -> c_int;
                #[link_name = $restore]
                fn restore(state: *mut Raw, table: *const Table, period_us: u32, words: *const Word, off: u32)
                    -> c_int;
                #[link_name = $angle]
                fn angle(angle: *mut RawAngle, bias: $number, dt: $interval, increment: *mut $number) -> c_int;
            }

            impl Table {
                /// Numbers of a sample: the temperature and the auxiliary channels.
                #[must_use]
                pub fn n_channels(&self) -> usize {
                    self.head[24] as usize
                }

                /// Length of a block in microseconds.
                #[must_use]
                pub fn block_us(&self) -> u32 {
                    self.head[5]
                }

                /// Biases are integers times 2^-this deg/h in fixed point; 0 in float32.
                #[must_use]
                pub fn bias_frac_bits(&self) -> u32 {
                    self.head[8]
                }

                /// Boot self-test: layout, arithmetic, checksum, ranges, known answers.
                ///
                /// # Errors
                /// [`Error::Layout`], [`Error::Image`], [`Error::SelfTest`].
                pub fn check(&self) -> Result<(), Error> {
                    done(unsafe { check(self) }).map(|_| ())
                }
            }

            /// A table that reads an image in place.
            pub struct Opened<'w> {
                table: Table,
                words: PhantomData<&'w [Word]>,
            }

            impl<'w> Opened<'w> {
                /// Makes a table from a binary image, `expected_id` is `GTC_<ID>_ID` of the emitted header.
                ///
                /// # Errors
                /// [`Error::Image`], [`Error::Layout`], [`Error::Id`].
                pub fn new(words: &'w [Word], expected_id: u32) -> Result<Self, Error> {
                    let count = u32::try_from(words.len()).map_err(|_| Error::Image)?;
                    let mut table = Table {
                        head: [0; 33],
                        arrays: [ptr::null(); 8],
                        crc: 0,
                        term_code: ptr::null(),
                    };
                    done(unsafe { open(&mut table, words.as_ptr(), count, expected_id) })?;
                    Ok(Self { table, words: PhantomData })
                }
            }

            impl core::ops::Deref for Opened<'_> {
                type Target = Table;
                fn deref(&self) -> &Table {
                    &self.table
                }
            }

            /// State of one table; all calls come from one task. A clone is a copy of the state.
            #[derive(Clone)]
            pub struct State<'t> {
                raw: Raw,
                table: PhantomData<&'t Table>,
            }

            unsafe impl Send for State<'_> {}

            impl<'t> State<'t> {
                /// Starts a state for samples that come each `period_us` microseconds.
                ///
                /// # Errors
                /// [`Error::Layout`], [`Error::Period`].
                pub fn new(table: &'t Table, period_us: u32) -> Result<Self, Error> {
                    let mut state = Self::zeroed();
                    done(unsafe { init(&mut state.raw, table, period_us) })?;
                    Ok(state)
                }

                /// Takes over what is kept over `off_blocks` whole blocks without power.
                ///
                /// # Errors
                /// [`Error::Image`], [`Error::Id`], [`Error::Layout`], [`Error::Period`]: start with [`State::new`].
                pub fn restore(
                    table: &'t Table,
                    period_us: u32,
                    words: &[Word; SAVE_WORDS],
                    off_blocks: u32,
                ) -> Result<Self, Error> {
                    let mut state = Self::zeroed();
                    done(unsafe { restore(&mut state.raw, table, period_us, words.as_ptr(), off_blocks) })?;
                    Ok(state)
                }

                /// The state as words, for flash.
                ///
                /// # Errors
                /// None for a state that [`State::new`] or [`State::restore`] gave.
                pub fn save(&self) -> Result<[Word; SAVE_WORDS], Error> {
                    let mut words = [0; SAVE_WORDS];
                    done(unsafe { save(&self.raw, words.as_mut_ptr()) })?;
                    Ok(words)
                }

                /// What was read `elapsed_us` after the call before: the temperature, then the auxiliary channels of the
                /// table; `None`: nothing was.
                ///
                /// # Errors
                /// [`Error::Argument`] for another number of channels; no reading is an error.
                pub fn sample(&mut self, elapsed_us: u32, channels: Option<&[$number]>) -> Result<Remarks, Error> {
                    let readings = match channels {
                        Some(readings) => {
                            self.fitting(readings)?;
                            readings.as_ptr()
                        }
                        None => ptr::null(),
                    };
                    done(unsafe { sample(&mut self.raw, elapsed_us, readings) })
                }

                /// The correction in force; compensated = measured - bias.
                ///
                /// # Errors
                /// None for a state that [`State::new`] or [`State::restore`] gave.
                pub fn bias(&self) -> Result<($number, Remarks), Error> {
                    let mut value = <$number>::default();
                    let remarks = done(unsafe { bias(&self.raw, &mut value) })?;
                    Ok((value, remarks))
                }

                /// The correction with its uncertainty, for the bias state of a filter.
                ///
                /// # Errors
                /// [`Error::Layout`] for a table without uncertainties.
                pub fn snapshot(&self) -> Result<(Snapshot, Remarks), Error> {
                    let mut value = Snapshot::default();
                    let remarks = done(unsafe { snapshot(&self.raw, &mut value) })?;
                    Ok((value, remarks))
                }

                /// Moves the constant by a rest of known length, within the table's bound; 0 seconds take every re-zero back.
                ///
                /// # Errors
                /// [`Error::Argument`], or [`Error::Layout`] for a table that grants no shift.
                pub fn rezero(&mut self, mean_rate: $number, seconds: u32) -> Result<Remarks, Error> {
                    done(unsafe { rezero(&mut self.raw, mean_rate, seconds) })
                }

                fn fitting(&self, channels: &[$number]) -> Result<(), Error> {
                    // The table outlives the state, 't says so.
                    let expected = unsafe { &*self.raw.table }.n_channels();
                    if channels.len() == expected { Ok(()) } else { Err(Error::Argument) }
                }

                fn zeroed() -> Self {
                    // Every member is a number or a pointer that `init` writes before anything reads it.
                    Self { raw: unsafe { core::mem::zeroed() }, table: PhantomData }
                }
            }

            /// Sum of angle increments, apart from any state.
            #[derive(Clone, Default)]
            pub struct Angle {
                raw: RawAngle,
            }

            impl Angle {
                /// The angle to subtract from an angle increment over `dt`; what rounding leaves is carried on.
                ///
                /// # Errors
                /// [`Error::Argument`]: nothing is lost, the rest is as it was.
                pub fn increment(&mut self, bias: $number, dt: $interval) -> Result<$number, Error> {
                    let mut value = <$number>::default();
                    done(unsafe { angle(&mut self.raw, bias, dt, &mut value) })?;
                    Ok(value)
                }
            }

            #[cfg(test)]
            pub(crate) fn sizes() -> [usize; 4] {
                use core::mem::size_of;
                [size_of::<Table>(), size_of::<State>(), size_of::<Snapshot>(), size_of::<Angle>()]
            }
        }
    };
}

#[repr(C)]
#[derive(Clone)]
struct FixedInput {
    words: [Word; 13],
    sum: i64,
}

arithmetic! {
    /// float32: C, C per block, deg/h; increments in arcsec over seconds.
    float32, number f32, age f32, interval f32,
    state words 53, input [Word; 14], inputs MAX_TERMS + 1, angle [f32; 2],
    "gtc_f32_check" "gtc_f32_open"
    "gtc_f32_init_20blocks_4terms" "gtc_f32_sample"
    "gtc_f32_bias" "gtc_f32_snapshot"
    "gtc_f32_rezero" "gtc_f32_save"
    "gtc_f32_restore_20blocks_4terms" "gtc_f32_angle"
}

arithmetic! {
    /// Fixed point: 2^-16 C, 2^-16 C per block, 2^-`bias_frac_bits` deg/h; increments over microseconds.
    q31, number i32, age i32, interval i32,
    state words 53, input crate::FixedInput, inputs MAX_TERMS + 1, angle i64,
    "gtc_q31_check" "gtc_q31_open"
    "gtc_q31_init_20blocks_4terms" "gtc_q31_sample"
    "gtc_q31_bias" "gtc_q31_snapshot"
    "gtc_q31_rezero" "gtc_q31_save"
    "gtc_q31_restore_20blocks_4terms" "gtc_q31_angle"
}

#[cfg(test)]
mod tests {
    extern "C" {
        static gtc_rust_sizes: [core::ffi::c_ulong; 8];
    }

    #[test]
    fn structs_have_the_sizes_of_c() {
        let (float, fixed) = (crate::float32::sizes(), crate::q31::sizes());
        let c = unsafe { gtc_rust_sizes };
        for k in 0..4 {
            assert_eq!(float[k], usize::try_from(c[2 * k]).unwrap());
            assert_eq!(fixed[k], usize::try_from(c[2 * k + 1]).unwrap());
        }
    }
}
