#include "core/microscope/simulation/gpu/device_simulation.hpp"

// The compiler's output as it is, see CMakeLists.txt.
#ifdef PROOFMASS_PTX_FILE
asm(".section .rodata\n"
    "proofmass_ptx_begin: .incbin \"" PROOFMASS_PTX_FILE
    "\"\n"
    "proofmass_ptx_end: .byte 0\n"
    ".text\n");
extern "C" const char proofmass_ptx_begin[], proofmass_ptx_end[];

namespace proofmass::gpu {
std::string_view program() { return {proofmass_ptx_begin, proofmass_ptx_end}; }
}  // namespace proofmass::gpu
#else
namespace proofmass::gpu {
std::string_view program() { return {}; }
}  // namespace proofmass::gpu
#endif
