#include "worker/net/serve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>
#include <variant>

#include "proto/link/faults.hpp"
#include "proto/link/init_system.hpp"
#include "proto/wire/codec.hpp"
#include "worker/net/coordinator_link.hpp"
#include "worker/spool/spool.hpp"

namespace proofmass::worker {
namespace {

using wire::Field;

constexpr std::chrono::milliseconds tick_interval(100);
constexpr std::chrono::seconds awake_turn_max(1);       ///< Longer ones were spent asleep.
constexpr std::chrono::milliseconds fault_interval(5);  ///< How exactly faults are timed.
constexpr std::chrono::seconds spool_interval(30);

TimePoint time_now() { return std::chrono::steady_clock::now(); }

/// True, and the time is set to come after the interval, if it has come.
bool take_turn(TimePoint& due_at, TimePoint now, Duration interval) {
  if (now < due_at) return false;
  due_at = now + interval;
  return true;
}

/// Keeps results that nobody acknowledges in a file, if there is one.
class Keeping {
 public:
  Keeping(const std::optional<std::filesystem::path>& path, std::string_view model,
          Conversation& conversation, const wire::Log& log)
      : conversation_(conversation), log_(log) {
    if (!path) return;
    spool_.emplace(*path, model);
    spooler_.emplace(*spool_);
    if (spool_->num_bytes_dropped() > 0) {
      log_({.severity = wire::Severity::warning,
            .kind = "spool_torn",
            .fields = {{"bytes_dropped", spool_->num_bytes_dropped()}}});
    }
    if (spool_->former_results().empty()) return;
    log_({.kind = "spool_read", .fields = {{"results", spool_->former_results().size()}}});
    conversation_.restore(spool_->former_results());
  }

  void on_tick(TimePoint now) {
    if (!spooler_ || !take_turn(due_at_, now, spool_interval)) return;
    warn(spooler_->look(conversation_.unacknowledged()));
  }

  void finish() {
    if (spooler_) {
      warn(spooler_->finish(conversation_.unacknowledged()));
    } else if (conversation_.num_unacknowledged() > 0) {
      log_(
          {.severity = wire::Severity::warning,
           .kind = "results_lost",
           .fields = {{"results", conversation_.num_unacknowledged()}, Field::reason("no spool")}});
    }
  }

 private:
  void warn(const std::optional<std::string>& reason) {
    if (reason && reason != former_reason_) {
      log_({.severity = wire::Severity::warning,
            .kind = "spool_failed",
            .fields = {Field::remark(*reason)}});
    }
    former_reason_ = reason;
  }

  Conversation& conversation_;
  const wire::Log& log_;
  std::optional<Spool> spool_;
  std::optional<Spooler> spooler_;
  std::optional<std::string> former_reason_;
  TimePoint due_at_ = TimePoint::min();
};

std::string status_of(const Conversation& conversation) {
  return fmt::format("{}, {} runs at hand, {} results not acknowledged, {} of them not served now",
                     conversation.is_registered() ? "registered" : "not registered",
                     conversation.num_unfinished(), conversation.num_unacknowledged(),
                     conversation.num_set_aside());
}

class Service {
 public:
  Service(const ServeConfig& config, Execution& execution, const wire::Wake& progress,
          StopSignals& signals)
      : log_(config.log),
        progress_(progress),
        signals_(signals),
        link_(config.endpoint, config.security),
        wait_max_(link_.has_faults() ? fault_interval : tick_interval),
        conversation_(
            config.session, config.hello, execution,
            [this](proto::Envelope message) { send(std::move(message)); }, time_now(),
            config.conversation),
        keeping_(config.spool, config.hello.model_version(), conversation_, log_) {}

  Ending run() {
    TimePoint tick_at = time_now();
    TimePoint turned_at = tick_at;
    while (!conversation_.ending()) {
      link_.wait(std::array{progress_.descriptor(), signals_.descriptor()}, wait_max_);
      const TimePoint now = time_now();
      const Duration turn_time = now - std::exchange(turned_at, now);
      if (turn_time > awake_turn_max) conversation_.on_slept(turn_time);
      heed_link(now);
      if (progress_.take()) conversation_.on_progress(now);
      heed_signals(now);
      if (take_turn(tick_at, now, tick_interval)) on_tick(now);
      for (const wire::Event& event : conversation_.take_events()) log_(event);
    }
    notices_.stopping();
    keeping_.finish();
    return *conversation_.ending();
  }

 private:
  void heed_link(TimePoint now) {
    if (link_.take_connected()) {
      log_({.kind = "connected"});
      conversation_.on_connected(now);
    }
    if (const auto refusal = link_.take_refusal()) {
      log_({.severity = wire::Severity::error,
            .kind = "connection_refused",
            .fields = {Field::reason(*refusal)}});
      conversation_.on_refused(*refusal);
    }
    link_.receive(now, [&](std::string_view bytes) {
      receive(bytes, now);
      return !conversation_.ending();
    });
  }

  void receive(std::string_view bytes, TimePoint now) {
    const auto decoded = wire::decode(bytes);
    if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
      return log_({.severity = wire::Severity::error,
                   .kind = "malformed_message",
                   .fields = {Field::remark(error->text)}});
    }
    const auto& message = std::get<proto::Envelope>(decoded);
    if (message.has_run_lease()) wire::kill_point(wire::KillPoint::after_lease);
    const bool was_registered = conversation_.is_registered();
    conversation_.on_message(message, now);
    if (conversation_.is_registered() && !was_registered) log_({.kind = "registered"});
  }

  void send(proto::Envelope message) {
    const bool has_results = message.has_result_batch();
    if (has_results) wire::kill_point(wire::KillPoint::before_result);
    if (message.has_bye()) wire::kill_point(wire::KillPoint::before_bye);
    link_.send(wire::encode(std::move(message)), time_now());
    if (has_results) wire::kill_point(wire::KillPoint::after_result);
  }

  void heed_signals(TimePoint now) {
    const EndRequest request = signals_.request();
    if (request == former_request_) return;
    former_request_ = request;
    log_({.kind = "asked_to_end",
          .fields = {{"how", request == EndRequest::drain ? "drain" : "at_once"}}});
    if (request == EndRequest::drain) {
      conversation_.on_drain_request(now);
    } else {
      conversation_.on_abandon_request();
    }
  }

  void on_tick(TimePoint now) {
    conversation_.on_tick(now);
    if (conversation_.take_reconnection()) link_.reconnect();
    keeping_.on_tick(now);
    if (conversation_.is_registered()) notices_.ready();
    if (conversation_.is_leaving()) notices_.stopping();
    notices_.on_tick(now, [this] { return status_of(conversation_); });
  }

  const wire::Log& log_;
  const wire::Wake& progress_;
  StopSignals& signals_;
  EndRequest former_request_ = EndRequest::none;
  CoordinatorLink link_;
  Duration wait_max_;
  Conversation conversation_;
  Keeping keeping_;
  wire::ServiceNotices notices_;
};

}  // namespace

Ending serve(const ServeConfig& config, Execution& execution, const wire::Wake& progress,
             StopSignals& signals) {
  return Service(config, execution, progress, signals).run();
}

}  // namespace proofmass::worker
