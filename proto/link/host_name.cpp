#include "proto/link/host_name.hpp"

#include <unistd.h>

#include <array>

#include "proto/wire/names.hpp"

namespace proofmass::wire {

std::string host_name() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return name_from(name.data());
}

}  // namespace proofmass::wire
