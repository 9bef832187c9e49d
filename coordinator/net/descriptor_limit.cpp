#include "coordinator/net/descriptor_limit.hpp"

#include <sys/resource.h>

#include "core/error.hpp"

namespace proofmass::coordinator {

void raise_descriptor_limit() {
  rlimit limit{};
  PROOFMASS_EXPECT(getrlimit(RLIMIT_NOFILE, &limit) == 0);
  limit.rlim_cur = limit.rlim_max;
  // Where even this is forbidden, the service has what it was given.
  [[maybe_unused]] const int status = setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace proofmass::coordinator
