#include "procs/viewer_export/live_questions.h"

#include <algorithm>

namespace mapmend {

LiveQuestions::Answer LiveQuestions::Ask(const Question& question, std::chrono::milliseconds timeout) {
  const auto waiting = std::make_shared<Waiting>();
  waiting->question = question;
  std::unique_lock lock(mutex_);
  if (waiting_.size() >= kMostWaiting) return {503, "text/plain; charset=utf-8", "Too many questions: ask again.\n"};
  waiting_.push_back(waiting);
  if (answered_.wait_for(lock, timeout, [&] { return waiting->is_answered; })) return waiting->answer;
  waiting_.erase(std::remove(waiting_.begin(), waiting_.end(), waiting), waiting_.end());
  return {503, "text/plain; charset=utf-8", "The viewer is busy: ask again.\n"};
}

void LiveQuestions::AnswerOne(const std::function<Answer(const Question&)>& answer) {
  std::shared_ptr<Waiting> oldest;
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.empty()) return;
    oldest = waiting_.front();
    waiting_.pop_front();
  }
  const Answer given = answer(oldest->question);
  const std::lock_guard lock(mutex_);
  oldest->answer = given;
  oldest->is_answered = true;
  answered_.notify_all();
}

}  // namespace mapmend
