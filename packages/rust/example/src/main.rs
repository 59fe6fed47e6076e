//! Feeds a ramp with a missing reading to both arithmetics and prints the bits of what they give.

use gyrotc::{float32, q31, Error};

extern "C" {
    static gtc_rlg_0042_f32: float32::Table;
    static gtc_rlg_0042_q31: q31::Table;
}

const PERIOD_US: u32 = 1_000_000;
const SAMPLES: u16 = 600;

fn main() -> Result<(), Error> {
    let (float, fixed) = unsafe { (&gtc_rlg_0042_f32, &gtc_rlg_0042_q31) };
    float.check()?;
    fixed.check()?;
    let mut single = float32::State::new(float, PERIOD_US)?;
    let mut integer = q31::State::new(fixed, PERIOD_US)?;
    assert_eq!(single.sample(PERIOD_US, Some(&[0.0, 0.0])), Err(Error::Argument), "the table has one channel");
    for k in 0..SAMPLES {
        if k == 300 {
            let words = integer.save()?;
            integer = q31::State::restore(fixed, PERIOD_US, &words, 0)?;
        }
        if k % 100 == 99 {
            let _ = single.sample(PERIOD_US, None)?;
            let _ = integer.sample(PERIOD_US, None)?;
        } else {
            let _ = single.sample(PERIOD_US, Some(&[20.0 + f32::from(k) / 64.0]))?;
            let _ = integer.sample(PERIOD_US, Some(&[20 * 65536 + i32::from(k) * 1024]))?;
        }
        let ((a, remarks), (b, _)) = (single.bias()?, integer.bias()?);
        println!("{k} {:08x} {:08x} {}", a.to_bits(), b, remarks.0);
    }
    Ok(())
}
