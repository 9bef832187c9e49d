#include "worker/net/stop_signals.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/error.hpp"
#include "worker/supervision/supervisor.hpp"

namespace proofmass::worker {
namespace {

int open_signals(SignalSource source) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
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

}  // namespace proofmass::worker
