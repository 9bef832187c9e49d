#pragma once

#include <functional>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/dispatch/state.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/store/records.hpp"
#include "coordinator/store/store_writer.hpp"

namespace proofmass::coordinator {

/// What the parts of a service have in common. They keep references to it: it outlives them.
struct ServiceContext {
  const ServiceConfig& config;
  CoordinatorStart start;
  State& state;
  StoreWriter& writer;
  Background& background;
  Outbox& outbox;
  std::function<TimePoint()> now;
};

}  // namespace proofmass::coordinator
