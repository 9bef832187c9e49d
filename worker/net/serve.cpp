#include "worker/net/serve.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/faults.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/codec.hpp"
#include "worker/spool/spool.hpp"
#include "worker/supervision/supervisor.hpp"

namespace proofmass::worker {
namespace {

using wire::Field;

constexpr std::chrono::milliseconds tick_interval(100);
constexpr std::chrono::seconds awake_turn_max(1);       ///< Longer ones were spent asleep.
constexpr std::chrono::milliseconds fault_interval(5);  ///< How exactly faults are timed.
constexpr std::chrono::seconds spool_interval(30);
constexpr std::chrono::seconds silence_min(10);  ///< Of which a warning says that nobody answers.

TimePoint time_now() { return std::chrono::steady_clock::now(); }

/// A worker's connection to its coordinator, made again whenever it is lost. What is sent without
/// one, or faster than the network takes it, is lost.
class CoordinatorLink {
 public:
  /// Begins to connect.
  /// @throws Error if the socket cannot be made.
  CoordinatorLink(const std::string& endpoint, const wire::ClientSecurity& security)
      : endpoint_(endpoint), security_(security) {
    connect();
  }

  /// Whether messages come late on purpose.
  [[nodiscard]] bool has_faults() const { return connection_->sending != nullptr; }

  /// Leaves the connection, with what has not been sent, and makes another one.
  void reconnect() {
    connection_->socket.set(zmq::sockopt::linger, 0);
    connect();
  }

  /// Waits until there is something to receive or one of the descriptors is readable, at most for
  /// this time.
  void wait(std::span<const int> descriptors, Duration time_max) {
    auto& [context, socket, monitor, sending, receiving, was_connected, is_newly_connected,
           can_send] = *connection_;
    // A connection takes messages only some time after its handshake.
    const short wanted = is_newly_connected ? ZMQ_POLLIN | ZMQ_POLLOUT : ZMQ_POLLIN;
    std::vector<zmq::pollitem_t> items{{socket.handle(), 0, wanted, 0},
                                       {monitor.handle(), 0, ZMQ_POLLIN, 0}};
    for (const int descriptor : descriptors) items.push_back({nullptr, descriptor, ZMQ_POLLIN, 0});
    try {
      zmq::poll(items, std::chrono::ceil<std::chrono::milliseconds>(time_max));
    } catch (const zmq::error_t& error) {
      // A process that was stopped and continued comes back here.
      if (error.num() != EINTR) throw;
    }
    monitor.update(time_now());
    const bool is_connected = monitor.is_connected();
    is_newly_connected = is_connected && (is_newly_connected || !was_connected);
    was_connected = is_connected;
    can_send = (items[0].revents & ZMQ_POLLOUT) != 0;
  }

  void send(std::string bytes, TimePoint now) {
    if (!connection_->sending) return transmit(bytes);
    connection_->sending->pass("", std::move(bytes), now);
    transmit_due(now);
  }

  /// Hands the messages that have come to `handle`, until it returns false.
  void receive(TimePoint now, const std::function<bool(std::string_view)>& handle) {
    transmit_due(now);
    wire::LinkFaults* const faults = connection_->receiving.get();
    zmq::message_t frame;
    while (connection_->socket.recv(frame, zmq::recv_flags::dontwait)) {
      if (faults != nullptr) {
        faults->pass("", frame.to_string(), now);
      } else if (!handle(frame.to_string_view())) {
        return;
      }
    }
    if (faults == nullptr) return;
    for (const wire::Parcel& parcel : faults->due(now)) {
      if (!handle(parcel.bytes)) return;
    }
  }

  /// True if a connection was made since the last call.
  [[nodiscard]] bool take_connected() {
    return connection_->can_send && std::exchange(connection_->is_newly_connected, false);
  }
  /// Why the coordinator does not let this worker in, once for each reason.
  [[nodiscard]] std::optional<std::string> take_refusal() {
    return connection_->monitor.take_refusal();
  }

 private:
  struct Connection {
    Connection(const std::string& endpoint, const wire::ClientSecurity& security)
        : socket(wire::make_dealer(context, security)),
          monitor(context, socket, endpoint, security, time_now()) {}

    zmq::context_t context;
    zmq::socket_t socket;
    wire::ConnectionMonitor monitor;
    // Null unless something shall go wrong.
    std::unique_ptr<wire::LinkFaults> sending =
        wire::link_faults(wire::LinkFaults::Direction::sending);
    std::unique_ptr<wire::LinkFaults> receiving =
        wire::link_faults(wire::LinkFaults::Direction::receiving);
    bool was_connected = false;
    bool is_newly_connected = false;  ///< The connection is new, and nobody has been told.
    bool can_send = false;            ///< At the last look; looked at only while nobody was told.
  };

  void connect() {
    try {
      connection_ = std::make_unique<Connection>(endpoint_, security_);
    } catch (const zmq::error_t& error) {
      throw Error(fmt::format("connect = {} ({})", endpoint_, error.what()));
    }
  }

  void transmit_due(TimePoint now) {
    if (!connection_->sending) return;
    for (const wire::Parcel& parcel : connection_->sending->due(now)) transmit(parcel.bytes);
  }

  // What the queue has no room for is lost; the conversation repeats what is not answered.
  void transmit(const std::string& bytes) {
    (void)connection_->socket.send(zmq::buffer(bytes), zmq::send_flags::dontwait);
  }

  std::string endpoint_;
  wire::ClientSecurity security_;
  std::unique_ptr<Connection> connection_;
};

/// True, and the time is set to come after the interval, if it has come.
bool take_turn(TimePoint& due_at, TimePoint now, Duration interval) {
  if (now < due_at) return false;
  due_at = now + interval;
  return true;
}

std::string status_of(const Conversation& conversation) {
  return fmt::format("{}, {} runs at hand, {} results not acknowledged, {} of them not served now",
                     conversation.is_registered() ? "registered" : "not registered",
                     conversation.num_unfinished(), conversation.unacknowledged().size(),
                     conversation.unacknowledged().num_set_aside());
}

class Service {
 public:
  Service(const ServeConfig& config, Execution& execution, const wire::Wake& progress,
          StopSignals& signals)
      : log_(config.log),
        on_registered_(config.on_registered),
        endpoint_(config.endpoint),
        progress_(progress),
        signals_(signals),
        silence_min_(std::min<Duration>(silence_min, config.conversation.give_up_after / 2)),
        link_(config.endpoint, config.security),
        wait_max_(link_.has_faults() ? fault_interval : tick_interval),
        conversation_(
            config.session, config.hello, execution,
            [this](proto::Envelope message) { send(std::move(message)); }, time_now(),
            config.conversation) {
    if (config.spool) open_spool(*config.spool, config.hello.model_version());
  }

  Ending run() {
    if (const std::string reason = wire::reason_if_unknown(endpoint_); !reason.empty()) {
      log_(wire::Event::warning("coordinator_unknown",
                                {{"connect", endpoint_}, Field::reason(reason)}));
    }
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
    return keep_results(*conversation_.ending());
  }

 private:
  void open_spool(const std::filesystem::path& path, std::string_view model) {
    spool_.emplace(path, model);
    if (!spool_->former_spool().empty()) {
      log_(wire::Event::warning("spool_of_another_model",
                                {{"kept_as", spool_->former_spool().string()}}));
    }
    if (spool_->num_bytes_dropped() > 0) {
      log_(wire::Event::warning("spool_torn", {{"bytes_dropped", spool_->num_bytes_dropped()}}));
    }
    if (spool_->former_results().empty()) return;
    log_(wire::Event::info("spool_read", {{"results", spool_->former_results().size()}}));
    conversation_.restore(spool_->former_results());
  }

  /// All that will not stay in memory, at the end.
  Ending keep_results(Ending ending) {
    const std::vector<wire::LeasedResult> kept = conversation_.unacknowledged().all();
    if (spool_) note_spool(spool_->finish(kept));
    const std::size_t num_lost = spool_ ? spool_->num_missing(kept) : kept.size();
    if (num_lost == 0) return ending;
    log_(wire::Event::warning(
        "results_lost",
        {{"results", num_lost}, Field::reason(spool_ ? spool_failure_.value_or("") : "no spool")}));
    if (!spool_ || ending.kind == Ending::Kind::failed) return ending;
    return {.kind = Ending::Kind::failed,
            .reason = fmt::format("{}; the spool cannot be written, and {} results are lost: they "
                                  "are computed again",
                                  ending.reason, num_lost)};
  }

  void note_spool(const std::optional<std::string>& failure) {
    if (failure && failure != spool_failure_) {
      log_(wire::Event::warning("spool_failed", {Field::remark(*failure)}));
    }
    spool_failure_ = failure;
  }

  void heed_link(TimePoint now) {
    if (link_.take_connected()) {
      log_(wire::Event::info("connected"));
      conversation_.on_connected(now);
    }
    if (const auto refusal = link_.take_refusal()) {
      log_(wire::Event::error("connection_refused", {Field::reason(*refusal)}));
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
      return log_(wire::Event::error("malformed_message", {Field::remark(error->text)}));
    }
    const auto& message = std::get<proto::Envelope>(decoded);
    if (message.has_run_lease()) wire::kill_point(wire::KillPoint::after_lease);
    const bool was_registered = conversation_.is_registered();
    conversation_.on_message(message, now);
    if (!conversation_.is_registered() || was_registered) return;
    on_registered_();
    log_(wire::Event::info("registered"));
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
    log_(wire::Event::info("asked_to_end",
                           {{"how", request == EndRequest::drain ? "drain" : "at_once"}}));
    if (request == EndRequest::drain) {
      conversation_.on_drain_request(now);
    } else {
      conversation_.on_abandon_request();
    }
  }

  /// After twice the time each time.
  void warn_of_silence(Duration silence) {
    if (silence < silence_min_) warn_after_ = silence_min_;
    if (silence < warn_after_) return;
    warn_after_ = 2 * silence;
    const auto silent_s = std::chrono::floor<std::chrono::seconds>(silence).count();
    log_(wire::Event::warning("coordinator_silent",
                              {{"connect", endpoint_},
                               {"silent_s", static_cast<std::uint64_t>(silent_s)},
                               Field::remark("(tries again)")}));
  }

  void on_tick(TimePoint now) {
    conversation_.on_tick(now);
    warn_of_silence(conversation_.silence(now));
    if (conversation_.take_reconnection()) link_.reconnect();
    if (spool_ && take_turn(spool_due_at_, now, spool_interval)) {
      note_spool(spool_->look(conversation_.unacknowledged().all()));
    }
    if (conversation_.is_registered()) notices_.ready();
    if (conversation_.is_leaving()) notices_.stopping();
    notices_.on_tick(now, [this] { return status_of(conversation_); });
  }

  const wire::Log& log_;
  const std::function<void()>& on_registered_;
  const std::string& endpoint_;
  const wire::Wake& progress_;
  StopSignals& signals_;
  EndRequest former_request_ = EndRequest::none;
  Duration silence_min_;  ///< Before it gives up, in any case.
  Duration warn_after_ = silence_min_;
  CoordinatorLink link_;
  Duration wait_max_;
  Conversation conversation_;
  std::optional<Spool> spool_;  ///< Of results that nobody acknowledges.
  std::optional<std::string> spool_failure_;
  TimePoint spool_due_at_ = TimePoint::min();
  wire::ServiceNotices notices_;
};

int open_signals(SignalSource source) {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : end_signals()) sigaddset(&set, signal);
  if (source == SignalSource::supervisor) sigaddset(&set, handed_on_signal());
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

/// What is asked for once this signal has come, too.
EndRequest after(EndRequest request, const signalfd_siginfo& signal, SignalSource source) {
  switch (source) {
    case SignalSource::anyone:
      return request == EndRequest::none ? EndRequest::drain : EndRequest::abandon;
    case SignalSource::supervisor: {
      const bool is_second =
          signal.ssi_signo == static_cast<std::uint32_t>(handed_on_signal()) && signal.ssi_int >= 2;
      return std::max(request, is_second ? EndRequest::abandon : EndRequest::drain);
    }
    case SignalSource::campaign:
      return signal.ssi_signo == SIGTERM ? EndRequest::abandon : request;
  }
  PROOFMASS_EXPECT(false);
}

}  // namespace

StopSignals::StopSignals(SignalSource source) : source_(source), descriptor_(open_signals(source)) {
  if (descriptor() < 0) throw Error(fmt::format("signalfd: {}", std::strerror(errno)));
}

EndRequest StopSignals::request() {
  signalfd_siginfo signal{};
  while (read(descriptor(), &signal, sizeof signal) == sizeof signal) {
    request_ = after(request_, signal, source_);
  }
  return request_;
}

Ending serve(const ServeConfig& config, Execution& execution, const wire::Wake& progress,
             StopSignals& signals) {
  return Service(config, execution, progress, signals).run();
}

}  // namespace proofmass::worker
