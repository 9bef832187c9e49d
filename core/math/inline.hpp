#pragma once

/// Marks a function of the sample loop. A batch of runs passes through some hundred of them a
/// sample in vector registers; a call would send every argument through memory.
#define PROOFMASS_INLINE inline __attribute__((always_inline))
