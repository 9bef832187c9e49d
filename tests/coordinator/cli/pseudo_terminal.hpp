#pragma once

#include <pty.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

namespace proofmass::test {

/// Gives a variable of the environment another value for a while.
class Variable {
 public:
  /// @param value  Null: the variable is not set.
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* const former = std::getenv(name)) former_ = former;
    set(value);
  }
  ~Variable() { set(former_ ? former_->c_str() : nullptr); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  void set(const char* value) const {
    if (value == nullptr) {
      unsetenv(name_);
    } else {
      setenv(name_, value, 1);
    }
  }

  const char* name_;
  std::optional<std::string> former_;
};

/// A terminal of 80 columns and 24 rows that takes the place of standard output while it lives.
class PseudoTerminal {
 public:
  PseudoTerminal() {
    winsize size{};
    size.ws_col = 80;
    size.ws_row = 24;
    int terminal = -1;
    if (openpty(&screen_, &terminal, nullptr, nullptr, &size) != 0) {
      throw std::runtime_error("openpty");
    }
    std::fflush(stdout);
    former_ = dup(STDOUT_FILENO);
    dup2(terminal, STDOUT_FILENO);
    close(terminal);
    reader_ = std::thread([this] { read_all(); });
  }
  ~PseudoTerminal() {
    if (reader_.joinable()) (void)shown();
  }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  /// All that was written to it; ends it. Lines end with \n alone.
  [[nodiscard]] std::string shown() {
    std::fflush(stdout);
    dup2(former_, STDOUT_FILENO);  // The last descriptor of the terminal is gone: reading ends.
    close(former_);
    reader_.join();
    close(screen_);
    std::erase(text_, '\r');
    return text_;
  }

 private:
  void read_all() {
    std::array<char, 4096> bytes{};
    for (ssize_t count = 0; (count = read(screen_, bytes.data(), bytes.size())) > 0;) {
      text_.append(bytes.data(), static_cast<std::size_t>(count));
    }
  }

  int screen_ = -1;
  int former_ = -1;
  std::string text_;
  std::thread reader_;
};

}  // namespace proofmass::test
