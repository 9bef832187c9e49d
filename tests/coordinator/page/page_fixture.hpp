#pragma once

#include <string>

#include "coordinator/page/page.hpp"
#include "tests/proto/wire/requests.hpp"

namespace proofmass::test {

/// Text that would be dangerous if it were not escaped.
inline const std::string hostile_name = "<script>alert(\"1\")</script>\n\x1b[31m&'\xff";

/// A token of a page.
inline const std::string page_secret = "a-secret-of-20-signs";

inline coordinator::CampaignRecord campaign_snapshot(const std::string& name,
                                                     std::uint64_t num_done,
                                                     std::uint64_t num_runs) {
  coordinator::CampaignRecord campaign;
  campaign.status = campaign_status(name, num_done, num_runs);
  campaign.file = "/nowhere/" + name + ".db";
  return campaign;
}

inline coordinator::RegisteredWorker worker_snapshot(const std::string& name, std::uint64_t id,
                                                     std::uint64_t num_results = 0) {
  coordinator::RegisteredWorker worker;
  worker.status.set_worker_id(id);
  worker.status.set_name(name);
  worker.status.set_host("host-" + name);
  worker.status.set_num_slots(4);
  worker.status.set_num_results(num_results);
  worker.registered_s = 3600.0;
  return worker;
}

/// Workers `w00000`, `w00001`, ... of which each has delivered more than those before it.
inline std::vector<coordinator::RegisteredWorker> many_workers(std::uint64_t count) {
  std::vector<coordinator::RegisteredWorker> workers;
  for (std::uint64_t i = 0; i < count; ++i) {
    std::string name = std::to_string(100'000 + i);
    name[0] = 'w';
    // Not in the order of their names.
    workers.push_back(worker_snapshot(name, (i * 7919) % count + 1, i));
  }
  return workers;
}

}  // namespace proofmass::test
