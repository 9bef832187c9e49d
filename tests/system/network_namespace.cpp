#include "tests/system/network_namespace.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mount.h>

#include <sstream>
#include <stdexcept>
#include <utility>

#include "tests/system/process.hpp"

namespace proofmass::test {
namespace {

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

}  // namespace

bool take_private_mounts() {
  return unshare(CLONE_NEWNS) == 0 &&
         mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
}

StarNetwork::StarNetwork(std::filesystem::path directory) : directory_(std::move(directory)) {
  // `ip` keeps the names of namespaces there.
  std::filesystem::create_directories("/run/netns");
  if (!take_private_mounts() || mount("tmpfs", "/run/netns", "tmpfs", 0, "size=1m") != 0) {
    throw std::runtime_error("private mounts: not permitted");
  }
  run("ip netns add hub");
  run("ip -n hub link set lo up");
  run(fmt::format("ip -n hub address add {}/32 dev lo", hub_address));
}

void StarNetwork::add(const std::string& machine) {
  const int number = static_cast<int>(lines_.size()) + 1;
  lines_[machine] = {.number = number};
  run(fmt::format("ip netns add {}", machine));
  run(fmt::format("ip -n hub link add line{} type veth peer name hub netns {}", number, machine));
  run(fmt::format("ip -n hub address add 10.77.{0}.1/24 dev line{0}", number));
  run(fmt::format("ip -n hub link set line{} up", number));
  run(fmt::format("ip -n {} link set lo up", machine));
  run(fmt::format("ip -n {} link set hub up", machine));
  give_address(machine);
}

std::vector<std::string> StarNetwork::at(const std::string& machine) {
  return {"ip", "netns", "exec", machine};
}

void StarNetwork::lose(const std::string& machine, double fraction) {
  const std::string which =
      fraction < 1.0 ? fmt::format("-m statistic --mode random --probability {}", fraction) : "";
  run(fmt::format("ip netns exec hub iptables -w -A INPUT -i line{} {} -j DROP",
                  lines_.at(machine).number, which));
  run(fmt::format("ip netns exec {} iptables -w -A INPUT {} -j DROP", machine, which));
}

void StarNetwork::mend(const std::string& machine) {
  run(fmt::format("ip netns exec {} iptables -w -F INPUT", machine));
  // The hub has rules for others, too.
  const std::string rules = "ip netns exec hub iptables -w -S INPUT";
  run(rules);
  std::istringstream lines(read_file(directory_ / "network.out"));
  for (std::string line; std::getline(lines, line);) {
    const std::string of_machine = fmt::format("-A INPUT -i line{} ", lines_.at(machine).number);
    if (line.rfind(of_machine, 0) == 0) {
      run("ip netns exec hub iptables -w -D " + line.substr(std::string("-A ").size()));
    }
  }
}

std::size_t StarNetwork::num_lost(const std::string& machine) const {
  run(fmt::format("ip netns exec {} iptables -w -nvxL INPUT", machine));
  std::istringstream lines(read_file(directory_ / "network.out"));
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string> words = words_of(line);
    if (words.size() > 2 && words[2] == "DROP") count += std::stoul(words[0]);
  }
  return count;
}

void StarNetwork::change_address(const std::string& machine) {
  run(fmt::format("ip -n {} address flush dev hub", machine));
  ++lines_.at(machine).address;
  give_address(machine);
}

void StarNetwork::give_address(const std::string& machine) const {
  const auto& [number, address] = lines_.at(machine);
  run(fmt::format("ip -n {} address add 10.77.{}.{}/24 dev hub", machine, number, address));
  run(fmt::format("ip -n {} route add default via 10.77.{}.1", machine, number));
}

void StarNetwork::run(const std::string& words) const {
  if (Process(directory_, "network", "/usr/bin/env", words_of(words)).wait() == 0) return;
  throw std::runtime_error(words + ": " + read_file(directory_ / "network.err"));
}

}  // namespace proofmass::test
