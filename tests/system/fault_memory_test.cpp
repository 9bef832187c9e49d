// Peers that make a coordinator hold more and more: its memory stays below the bound, and the
// campaign ends as if they had not been there.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <fstream>
#include <functional>
#include <memory>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "core/microscope/simulation/reference_digest.hpp"
#include "core/microscope/simulation/run.hpp"
#include "proto/wire/codec.hpp"
#include "tests/proto/link/raw_peer.hpp"
#include "tests/support/messages.hpp"
#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

constexpr std::size_t memory_mib_max = 256;

/// A peer that does something again and again, on a new connection whenever it is cut off.
class Nuisance {
 public:
  /// @param act  Once for each connection; told when to end. What it throws ends the connection.
  Nuisance(std::string endpoint, std::function<void(RawPeer&, const std::atomic<bool>&)> act)
      : endpoint_(std::move(endpoint)), act_(std::move(act)), thread_([this] { run(); }) {}
  ~Nuisance() {
    is_stopping_ = true;
    thread_.join();
  }
  Nuisance(const Nuisance&) = delete;
  Nuisance& operator=(const Nuisance&) = delete;

 private:
  void run() {
    while (!is_stopping_) {
      try {
        RawPeer peer(endpoint_);
        act_(peer, is_stopping_);
        peer.reset();
      } catch (const std::runtime_error&) {
        std::this_thread::yield();  // Cut off, or nobody there for a moment.
      }
    }
  }

  std::string endpoint_;
  std::function<void(RawPeer&, const std::atomic<bool>&)> act_;
  std::atomic<bool> is_stopping_ = false;
  std::thread thread_;
};

/// Sends the same bytes for ever.
void pour(RawPeer& peer, const std::string& bytes, const std::atomic<bool>& is_stopping) {
  std::string_view rest = bytes;
  while (!is_stopping) {
    const ssize_t count = peer.send_some(rest);
    if (count < 0) return;
    if (count == 0) std::this_thread::yield();
    rest.remove_prefix(static_cast<std::size_t>(count));
    if (rest.empty()) rest = bytes;
  }
}

std::string repeated(const std::string& text, std::size_t size) {
  std::string bytes;
  while (bytes.size() < size) bytes += text;
  return bytes;
}

class BoundedMemory : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(1000);
    workers_endpoint = "tcp://127.0.0.1:*";
    clients_endpoint = "tcp://127.0.0.1:*";
  }

  void start_coordinator(const Arguments& further = {}, const Arguments& prefix = {}) {
    Arguments arguments{"null.toml", "--memory-max", std::to_string(memory_mib_max)};
    arguments.insert(arguments.end(), further.begin(), further.end());
    process_.reset(new Process(coordinator("coordinator", arguments, prefix)));
  }

  /// Reads the ports that the coordinator found from its log.
  void find_endpoints() {
    wait_for_log("coordinator", "coordinator_started");
    std::smatch found;
    const std::string log = errors_of("coordinator");
    ASSERT_TRUE(std::regex_search(log, found, std::regex("bind=(\\S+) bind_clients=(\\S+)")));
    workers_endpoint = found[1];
    clients_endpoint = found[2];
  }

  /// A figure of /proc/PID/status, MiB.
  [[nodiscard]] std::size_t memory_mib(const std::string& name) const {
    std::istringstream status(read_file("/proc/" + std::to_string(process_->id()) + "/status"));
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with(name + ":")) return std::stoul(line.substr(name.size() + 1)) / 1024;
    }
    throw std::runtime_error("no " + name);
  }
  [[nodiscard]] std::size_t peak_mib() const { return memory_mib("VmHWM"); }

  /// The campaign ends, with the right digest, while the nuisances go on.
  void expect_end(std::size_t num_resets_min) {
    const Process worker = null_worker("worker", {"--run-time", "0.02"});
    wait_for_log("coordinator", "campaign_finished");
    wait_until("resets",
               [&] { return num_log_lines("coordinator", "] sockets_reset ") >= num_resets_min; });
    RecordProperty("peak_mib", static_cast<int>(peak_mib()));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // They take far more.
    EXPECT_LT(peak_mib(), memory_mib_max) << errors_of("coordinator");
    EXPECT_EQ(num_log_lines("coordinator", "memory_high"), 0U) << errors_of("coordinator");
#endif
    process_->signal(SIGTERM);
    EXPECT_EQ(process_->wait(), 0) << errors_of("coordinator");
    EXPECT_EQ(digest("null"), undisturbed_digest("null"));
  }

  std::unique_ptr<Process> process_;
};

// The library collects the frames of a message until the last has come.
TEST_F(BoundedMemory, HoldsAgainstMessagesThatNeverEnd) {
  start_coordinator();
  find_endpoints();
  const std::string large = RawPeer::frame(RawPeer::more, std::string(60'000, 'x'));
  const std::string small = repeated(RawPeer::frame(RawPeer::more, "x"), 60'000);
  std::vector<std::unique_ptr<Nuisance>> nuisances;
  for (const std::string& bytes : {large, small}) {
    for (const std::string& endpoint : {workers_endpoint, clients_endpoint}) {
      nuisances.push_back(std::make_unique<Nuisance>(
          endpoint, [bytes](RawPeer& peer, const std::atomic<bool>& is_stopping) {
            peer.introduce();
            pour(peer, bytes, is_stopping);
          }));
    }
  }
  wait_for_log("coordinator", "] sockets_reset ");
  expect_end(2);
}

/// A worker that asks for a large definition again and again and reads no answer.
void ask_and_not_read(RawPeer& peer, std::uint64_t session, const std::atomic<bool>& is_stopping) {
  peer.introduce();
  std::uint64_t epoch = 0;
  std::uint64_t num_sent = 0;
  const auto say = [&](const auto& content) {
    proto::Envelope envelope = in_envelope(content);
    envelope.set_session(session);
    envelope.set_epoch(epoch);
    envelope.set_sequence(++num_sent);
    peer.send(RawPeer::frame(0, wire::encode(envelope)));
  };
  proto::Hello hello = make_hello("asker", "there", 1, model_version);
  hello.set_reference_digest(reference_digest(best_instruction_set()));
  say(hello);
  for (;;) {
    const auto message = std::get<proto::Envelope>(wire::decode(peer.receive()));
    if (message.has_reject()) throw std::runtime_error("rejected");
    if (message.has_welcome()) {
      epoch = message.epoch();
      say(make_heartbeat(1));
    }
    if (!message.has_run_lease()) continue;
    for (int i = 0; i < 300; ++i) say(make_request({message.run_lease().campaign()}));
    break;
  }
  wait_until("the end, or a cut", [&] { return is_stopping || peer.send_some("") < 0; });
}

// A campaign with an environment of 2.2 MB, which travels to each worker that asks.
TEST_F(BoundedMemory, HoldsWhileNobodyReadsTheAnswers) {
  std::string campaign = read_file(path("null.toml"));
  campaign = std::regex_replace(campaign, std::regex("\nkind = \"harmonic\""),
                                "\nkind = \"file\"\nfile = \"environment.csv\"",
                                std::regex_constants::format_first_only);
  std::ofstream(path("null.toml")) << campaign;
  std::ofstream table(path("environment.csv"));
  table << "time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,angular_x_rad_s2,angular_y_rad_s2,"
           "angular_z_rad_s2\n";
  for (int i = 0; i <= 40'000; ++i) table << 0.2 * i << ",1e-9,2e-9,3e-9,0,0,0\n";
  table.close();
  start_coordinator();
  find_endpoints();
  std::vector<std::unique_ptr<Nuisance>> nuisances;
  for (std::uint64_t session = 5001; session <= 5010; ++session) {
    nuisances.push_back(std::make_unique<Nuisance>(
        workers_endpoint, [session](RawPeer& peer, const std::atomic<bool>& is_stopping) {
          ask_and_not_read(peer, session, is_stopping);
        }));
  }
  wait_for_log("coordinator", "] sockets_reset ");
  expect_end(1);
}

// A peer needs no key to send a frame of the handshake.
TEST_F(BoundedMemory, LetsPeersWithoutAKeyFillNoMoreThanAMebibyteEach) {
  Process keygen = start_behind({}, "keygen", "proofmass", {"keygen", "keys"});
  ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
  start_coordinator({"--keys", "keys"});
  find_endpoints();
  const std::size_t before = peak_mib();
  const auto fill = [](const std::string& endpoint, std::size_t size) {
    // All but the last byte, after which the frame would be looked at.
    const std::string body(size - 1, 'x');
    std::vector<std::unique_ptr<RawPeer>> peers;
    for (int i = 0; i < 30; ++i) {
      peers.push_back(std::make_unique<RawPeer>(endpoint));
      peers.back()->greet(RawPeer::Mechanism::curve);
      peers.back()->send(RawPeer::head_of_large(RawPeer::command, size));
    }
    for (const auto& peer : peers) {
      try {
        peer->send(body);
      } catch (const std::runtime_error&) {  // Cut off.
      }
    }
    return peers;
  };
  (void)fill(workers_endpoint, std::size_t{64} << 20);
  (void)fill(clients_endpoint, std::size_t{64} << 20);
  EXPECT_LT(peak_mib(), before + 10);
  const auto peers = fill(workers_endpoint, wire::router_message_size_max);
  wait_until("arrival", [&] { return peak_mib() > before + 25; });
  // They are cut off when they have taken too long.
  wait_for_log("coordinator", "reason=\"handshake takes too long\"");
  EXPECT_LT(peak_mib(), before + 40);
}

// The service's thread cannot go on while nobody reads its log: what arrives meanwhile is held by
// the library. Afterwards all goes on.
TEST_F(BoundedMemory, HoldsWhileTheServiceIsBusy) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "with sanitizers, memory that is freed stays resident";
#endif
  const std::string log = path("log").string();
  ASSERT_EQ(mkfifo(log.c_str(), 0600), 0);
  const int reader = open(log.c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_GE(reader, 0);
  ASSERT_GE(fcntl(reader, F_SETPIPE_SZ, 4096), 0);
  start_coordinator({}, {"sh", "-c", "exec \"$@\" 2> log", "sh"});
  std::string text;
  const auto read_log = [&] {
    std::string some(4096, '\0');
    some.resize(static_cast<std::size_t>(read(reader, some.data(), some.size())));
    text += some;
  };
  std::smatch found;
  while (!std::regex_search(text, found, std::regex("bind=(\\S+) bind_clients=(\\S+)"))) read_log();
  workers_endpoint = found[1];
  clients_endpoint = found[2];

  // Each garbage is a line of the log, until that is full.
  std::vector<std::unique_ptr<RawPeer>> strangers;
  const auto bytes_in_log = [&] {
    int count = 0;
    ioctl(reader, FIONREAD, &count);
    return count;
  };
  wait_until("a full log", [&] {
    strangers.push_back(std::make_unique<RawPeer>(workers_endpoint));
    strangers.back()->introduce();
    strangers.back()->send(RawPeer::frame(0, "garbage"));
    return bytes_in_log() > 4096 - 200;
  });
  {
    const std::string bytes = RawPeer::frame(0, std::string(60'000, 'x'));
    const Nuisance nuisance(workers_endpoint,
                            [&](RawPeer& peer, const std::atomic<bool>& is_stopping) {
                              peer.introduce();
                              pour(peer, bytes, is_stopping);
                            });
    const std::size_t before = memory_mib("VmRSS");
    // It grows, is cut, grows: three times.
    for (int i = 0; i < 3; ++i) {
      wait_until("growth", [&] { return memory_mib("VmRSS") > before + 60; });
      wait_until("a reset", [&] { return memory_mib("VmRSS") < before + 40; });
    }
    EXPECT_LT(peak_mib(), memory_mib_max);
  }
  std::atomic<bool> is_read = false;
  std::thread log_reader([&] {
    while (!is_read) read_log();
  });
  const Process worker = null_worker("worker", {"--run-time", "0.02"});
  wait_for_done("null", num_null_runs);
  process_->signal(SIGTERM);
  EXPECT_EQ(process_->wait(), 0) << text;
  is_read = true;
  ASSERT_EQ(write(reader, "\n", 1), 1);
  log_reader.join();
  close(reader);
  EXPECT_TRUE(contains(text, "] sockets_reset ")) << text;
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

}  // namespace
}  // namespace proofmass::test
