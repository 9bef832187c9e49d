#include "coordinator/net/request.hpp"

#include <utility>

#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

Request read(wire::SubmitRequest&& sent) {
  return Submission{.campaign = model().campaign_of(std::move(sent.definition),
                                                    TableColumns::included, "definition"),
                    .priority = sent.priority,
                    .audit_fraction = sent.audit_fraction,
                    .stop_rule = std::move(sent.stop_rule),
                    .failures_max = sent.failures_max};
}

template <typename Other>
Request read(Other&& sent) {
  return std::forward<Other>(sent);
}

}  // namespace

Request request_of(wire::ClientRequest sent) {
  return std::visit([](auto&& content) { return read(std::move(content)); }, std::move(sent));
}

}  // namespace proofmass::coordinator
