#include "worker/net/serve.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>
#include <variant>
#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

constexpr std::chrono::milliseconds tick_interval(200);

/// A file descriptor that becomes readable when something happened.
class Descriptor {
 public:
  explicit Descriptor(int fd, std::string_view what) : fd_(fd) {
    if (fd_ < 0) throw Error(fmt::format("{}: {}", what, std::strerror(errno)));
  }
  ~Descriptor() { close(fd_); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int fd() const { return fd_; }

  /// Makes an eventfd readable.
  void notify() const {
    const std::uint64_t one = 1;
    // It fails only if the counter is full, and then the descriptor is readable already.
    [[maybe_unused]] const auto written = write(fd_, &one, sizeof one);
  }

  /// Makes an eventfd not readable.
  void clear() const {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto got = read(fd_, &count, sizeof count);
  }

 private:
  int fd_;
};

int open_signals(Signals signals) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  if (signals == Signals::terminate_and_interrupt) sigaddset(&set, SIGINT);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

zmq::socket_t connect(zmq::context_t& context, const std::string& endpoint) {
  zmq::socket_t socket(context, zmq::socket_type::dealer);
  // Without a connection nothing is queued: the conversation repeats what matters.
  socket.set(zmq::sockopt::immediate, true);
  socket.set(zmq::sockopt::linger, 2000);
  socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(wire::welcome_size_max));
  socket.set(zmq::sockopt::reconnect_ivl, 100);
  socket.set(zmq::sockopt::reconnect_ivl_max, 5000);
  socket.set(zmq::sockopt::handshake_ivl, 5000);
  socket.set(zmq::sockopt::heartbeat_ivl, 5000);
  socket.set(zmq::sockopt::heartbeat_timeout, 20000);
  socket.set(zmq::sockopt::tcp_keepalive, 1);
  socket.connect(endpoint);
  return socket;
}

class Service {
 public:
  Service(const std::string& endpoint, const wire::Hello& hello, Prepare prepare,
          const ExecutorConfig& config, Signals signals)
      : signals_(open_signals(signals), "signalfd"),
        progress_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), "eventfd"),
        socket_(connect(context_, endpoint)),
        executor_(
            std::move(prepare), [this] { progress_.notify(); }, config),
        conversation_(
            hello, executor_, [this](const wire::Message& message) { send(message); }, now()) {}

  Ending run() {
    while (!conversation_.ending()) {
      const short wanted = is_connected_ ? ZMQ_POLLIN : ZMQ_POLLIN | ZMQ_POLLOUT;
      std::array<zmq::pollitem_t, 3> items{zmq::pollitem_t{socket_.handle(), 0, wanted, 0},
                                           zmq::pollitem_t{nullptr, progress_.fd(), ZMQ_POLLIN, 0},
                                           zmq::pollitem_t{nullptr, signals_.fd(), ZMQ_POLLIN, 0}};
      poll(items);
      if ((items[0].revents & ZMQ_POLLOUT) != 0) {
        is_connected_ = true;
        conversation_.on_connected(now());
      }
      if ((items[0].revents & ZMQ_POLLIN) != 0) receive();
      if (items[1].revents != 0) {
        progress_.clear();
        conversation_.on_progress(now());
      }
      if (items[2].revents != 0) conversation_.on_stop_request();
      conversation_.on_tick(now());
    }
    return *conversation_.ending();
  }

 private:
  static TimePoint now() { return std::chrono::steady_clock::now(); }

  static void poll(std::span<zmq::pollitem_t> items) {
    try {
      zmq::poll(items.data(), items.size(), tick_interval);
    } catch (const zmq::error_t& error) {
      // A process that was stopped and continued comes back here.
      if (error.num() != EINTR) throw;
    }
  }

  void receive() {
    zmq::message_t frame;
    while (!conversation_.ending() && socket_.recv(frame, zmq::recv_flags::dontwait)) {
      const auto decoded = wire::decode(frame.to_string_view());
      if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
        spdlog::error("malformed_message {}", error->text);
        continue;
      }
      conversation_.on_message(std::get<wire::Message>(decoded), now());
    }
  }

  void send(const wire::Message& message) {
    const std::string bytes = wire::encode(message);
    if (!socket_.send(zmq::buffer(bytes), zmq::send_flags::dontwait)) {
      spdlog::debug("message_not_sent bytes={}", bytes.size());
    }
  }

  Descriptor signals_;
  Descriptor progress_;
  zmq::context_t context_;
  zmq::socket_t socket_;
  bool is_connected_ = false;  ///< The socket found its coordinator once.
  Executor executor_;
  Conversation conversation_;
};

}  // namespace

Ending serve(const std::string& endpoint, const wire::Hello& hello, Prepare prepare,
             const ExecutorConfig& config, Signals signals) {
  try {
    return Service(endpoint, hello, std::move(prepare), config, signals).run();
  } catch (const zmq::error_t& error) {
    throw Error(fmt::format("connect = {} ({})", endpoint, error.what()));
  }
}

}  // namespace proofmass::worker
