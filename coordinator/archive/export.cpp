#include "coordinator/archive/export.hpp"

#include <cstdint>

#include "coordinator/report/digest.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

WalkedResults walk_results(const Store& store, const IsStopped& is_stopped,
                           const std::function<void(const RunResult&)>& visit) {
  constexpr std::uint64_t visits_between_questions = 1024;
  std::uint64_t num_visits = 0;
  return walk_checked(store, [&](const RunResult& result) {
    if (num_visits++ % visits_between_questions == 0 && is_stopped()) throw Interrupted();
    visit(result);
  });
}

void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const IsStopped& is_stopped) {
  check_definition_digest(store);
  (void)walk_results(store, is_stopped, [](const RunResult&) {});
  wire::DraftFile draft("output", file);
  store.write_plain(draft.draft());
  draft.publish(wire::IfThere::replace);
}

}  // namespace proofmass::coordinator
