#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <string>

#include "coordinator/net/authentication/rights.hpp"
#include "coordinator/net/background.hpp"
#include "coordinator/net/service.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

/// Answers clients' questions about results. Each is answered by the program `proofmass` in a
/// process of its own, with the command that a user would type on this machine: what a question
/// needs of time and memory never holds up the service. Its output is kept until it has been read,
/// in parts. Several clients may read the same answer: the gateway joins those who ask the same.
class Answers {
 public:
  static constexpr std::size_t num_computing_max = 4;      ///< Processes at a time.
  static constexpr std::size_t num_computing_per_key = 2;  ///< Computed at a time for one key.
  static constexpr std::size_t num_kept_max = 16;          ///< Answers that are being read.
  static constexpr std::chrono::seconds kept_for{60};      ///< After it was last read.
  /// How long an answer stays that was read to its end: another client may still be reading it. It
  /// does not count against num_kept_max, and makes room when that many are held.
  static constexpr std::chrono::seconds kept_after_end{10};
  /// Of an answer, bytes, unless it is a copy of the database.
  static constexpr std::uint64_t size_max = std::uint64_t{64} << 20;

  explicit Answers(const ServiceContext& context);
  ~Answers();  ///< Ends the processes.
  Answers(const Answers&) = delete;
  Answers& operator=(const Answers&) = delete;

  /// Begins to answer, and responds when the answer can be read.
  /// @param database  Of the campaign.
  /// @throws Error if the question has an option that its command does not have, or too many
  ///         questions are being answered.
  void ask(const proto::AnswerRequest& request, const std::filesystem::path& database,
           const Asker& asker, Respond respond);

  /// @throws Error if there is no such answer, or it was given to another key.
  [[nodiscard]] proto::ReplyEnvelope part(const proto::AnswerPartRequest& request,
                                          const Asker& asker);

  /// Responds to questions whose answers are there, and drops answers that nobody reads. To be
  /// called several times a second.
  void review();

 private:
  /// What came of a question.
  struct Computed {
    std::unique_ptr<wire::UnnamedFile> file;
    proto::AnswerReply reply;
  };
  struct Computing {
    std::string owner;
    Respond respond;
    std::shared_ptr<std::atomic<bool>> is_cancelled;
    std::uint64_t copy_size = 0;  ///< Bytes; 0 if no copy is made.
    std::future<Computed> result;
  };
  struct Kept {
    std::string owner;
    std::unique_ptr<wire::UnnamedFile> file;
    std::uint64_t size = 0;  ///< Bytes.
    TimePoint read_at;
    bool is_read = false;  ///< To its end, by one client at least.
  };

  void require_room(const std::string& owner) const;
  /// Drops the answer that was read to its end longest ago, if the limit of held answers is
  /// reached.
  void make_room();
  void finish(Computing& computing);

  const ServiceContext& context_;
  std::list<Computing> computing_;
  std::map<std::uint64_t, Kept> kept_;  ///< By number.
  std::uint64_t num_answers_ = 0;
};

}  // namespace proofmass::coordinator
