#pragma once

/// Marks a function of the sample loop. A batch of runs passes through some hundred of them a
/// sample in vector registers; a call would send every argument through memory. Compiled for a GPU
/// they are functions of host and device, which makes them the one source of both.
#ifdef __CUDA__
#define PROOFMASS_INLINE inline __attribute__((always_inline, host, device))
#else
#define PROOFMASS_INLINE inline __attribute__((always_inline))
#endif
