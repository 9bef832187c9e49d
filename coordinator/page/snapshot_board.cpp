#include "coordinator/page/snapshot_board.hpp"

#include <utility>

namespace proofmass::coordinator {

std::shared_ptr<const ServiceSnapshot> SnapshotBoard::want(SnapshotDepth depth, TimePoint now) {
  const bool needs_workers = depth == SnapshotDepth::with_workers;
  const std::lock_guard lock(mutex_);
  asked_at_ = now;
  if (needs_workers) asked_for_workers_at_ = now;
  const bool is_deep = !needs_workers || newest_depth_ == SnapshotDepth::with_workers;
  const bool is_there = newest_ != nullptr && is_deep && now - newest_->taken_at <= age_max;
  is_urgent_ = is_urgent_ || !is_there;
  return is_there ? newest_ : nullptr;
}

std::shared_ptr<const ServiceSnapshot> SnapshotBoard::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

void SnapshotBoard::on_turn(TimePoint now,
                            const std::function<ServiceSnapshot(SnapshotDepth)>& take) {
  std::unique_lock lock(mutex_);
  turned_at_ = now;
  if (!is_wanted(asked_at_, now)) return;
  const bool is_due = newest_ == nullptr || now - newest_->taken_at >= interval;
  const SnapshotDepth depth = is_wanted(asked_for_workers_at_, now)
                                  ? SnapshotDepth::with_workers
                                  : SnapshotDepth::without_workers;
  // Workers that are asked for the first time need not wait for the second to end.
  if (!is_due && (!is_urgent_ || depth == newest_depth_)) return;
  lock.unlock();
  ServiceSnapshot taken = take(depth);
  taken.taken_at = now;
  auto snapshot = std::make_shared<const ServiceSnapshot>(std::move(taken));
  lock.lock();
  newest_.swap(snapshot);  // What nobody uses any more is freed without the lock.
  newest_depth_ = depth;
  is_urgent_ = false;
  lock.unlock();
}

Duration SnapshotBoard::since_turn(TimePoint now) const {
  const std::lock_guard lock(mutex_);
  return now - turned_at_;
}

}  // namespace proofmass::coordinator
