#include "coordinator/cli/client_pages.hpp"

#include <iterator>
#include <utility>
#include <vector>

namespace proofmass::coordinator {
namespace {

template <typename Row>
void append(std::vector<Row>& rows, std::vector<Row>& further) {
  rows.insert(rows.end(), std::make_move_iterator(further.begin()),
              std::make_move_iterator(further.end()));
}

}  // namespace

// Campaigns are only ever added to the end of a coordinator's list.
wire::StatusReply whole_status(const Ask& ask) {
  auto status = reply_of<wire::StatusReply>(ask, wire::StatusRequest{});
  while (status.campaigns.size() < status.num_campaigns) {
    auto page = reply_of<wire::StatusReply>(
        ask, wire::StatusRequest{.first_campaign = status.campaigns.size()});
    if (page.campaigns.empty()) break;  // It has fewer now: it was started again.
    append(status.campaigns, page.campaigns);
  }
  return status;
}

wire::WorkersReply all_workers(const Ask& ask) {
  auto workers = reply_of<wire::WorkersReply>(ask, wire::WorkersRequest{});
  bool is_more = workers.workers.size() < workers.num_workers && !workers.workers.empty();
  while (is_more) {
    auto page = reply_of<wire::WorkersReply>(
        ask, wire::WorkersRequest{.after_worker_id = workers.workers.back().id.value});
    is_more = !page.workers.empty();
    append(workers.workers, page.workers);
  }
  return workers;
}

}  // namespace proofmass::coordinator
