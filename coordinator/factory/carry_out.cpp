#include "coordinator/factory/carry_out.hpp"

#include <chrono>
#include <string>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

void cancel(const std::string& id, const BatchSystem& system, const wire::Log& log) {
  try {
    (void)output_of(system.cancellation(id));
    log({.kind = "allocation_cancelled", .fields = {{"allocation", id}}});
  } catch (const Error& error) {
    log({.severity = wire::Severity::warning,
         .kind = "cancellation_failed",
         .fields = {{"allocation", id}, wire::Field::reason(error.what())}});
  }
}

/// @return Whether the batch system took it.
bool submit(FactoryState& state, const BatchSystem& system, const AllocationConfig& allocation,
            const wire::Log& log) {
  const auto now = std::chrono::steady_clock::now();
  try {
    const std::string id = system.id_of(output_of(system.submission(allocation)));
    on_submitted(state, id, now);
    log({.kind = "worker_requested", .fields = {{"allocation", id}}});
    return true;
  } catch (const Error& error) {
    on_submission_failed(state, error.what(), now, log);
    return false;
  }
}

}  // namespace

void carry_out(const FactoryActions& actions, FactoryState& state, const BatchSystem& system,
               const AllocationConfig& allocation, const wire::Log& log) {
  for (const std::string& id : actions.cancelled) cancel(id, system, log);
  for (std::uint64_t i = 0; i < actions.num_submissions; ++i) {
    if (!submit(state, system, allocation, log)) return;
  }
}

}  // namespace proofmass::coordinator
