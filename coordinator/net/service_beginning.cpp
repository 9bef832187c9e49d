#include "coordinator/net/service_beginning.hpp"

#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>
#include <variant>

#include "core/error.hpp"
#include "proto/link/host_name.hpp"

namespace proofmass::coordinator {
namespace {

wire::Epoch random_epoch() {
  wire::Epoch epoch;
  while (epoch.value == 0) {
    if (getrandom(&epoch.value, sizeof epoch.value, 0) < 0 && errno != EINTR) {
      throw Error(fmt::format("getrandom: {}", std::strerror(errno)));
    }
  }
  return epoch;
}

CoordinatorStart coordinator_start(wire::Epoch epoch, const std::string& version) {
  return {.epoch = epoch,
          .host = wire::host_name(),
          .process_id = static_cast<std::uint64_t>(getpid()),
          .version = version};
}

}  // namespace

Beginning beginning_of(std::vector<ServedCampaign> campaigns, const ServiceConfig& config) {
  Beginning beginning{
      .start = coordinator_start(random_epoch(), config.version), .campaigns = {}, .attached = {}};
  KnownCampaigns known;
  for (ServedCampaign& campaign : campaigns) {
    beginning.campaigns.emplace_back(
        prepare(std::move(campaign), config.given_up, beginning.start));
    known.add(beginning.campaigns.back());
  }
  if (config.directory != nullptr) {
    for (FileOutcome& outcome : look_at_all(*config.directory, known, beginning.start)) {
      beginning.campaigns.push_back(std::move(outcome));
    }
  }
  for (const FileOutcome& outcome : beginning.campaigns) {
    const auto* const prepared = std::get_if<PreparedCampaign>(&outcome);
    if (prepared == nullptr) continue;
    beginning.attached.insert(prepared->sessions.begin(), prepared->sessions.end());
  }
  return beginning;
}

}  // namespace proofmass::coordinator
