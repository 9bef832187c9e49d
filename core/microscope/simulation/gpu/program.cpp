#include "core/microscope/simulation/gpu/device_simulation.hpp"

// The compiler's output as it is, see CMakeLists.txt.
#ifdef PROOFMASS_PTX_FILE
asm(".section .rodata\n"
    "proofmass_ptx: .incbin \"" PROOFMASS_PTX_FILE
    "\"\n"
    ".byte 0\n"
    ".text\n");
extern "C" const char proofmass_ptx[];
#else
static constexpr char proofmass_ptx[] = "";
#endif

namespace proofmass::gpu {
const char* program() { return proofmass_ptx; }
}  // namespace proofmass::gpu
