#include "splitnerf/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace splitnerf {
namespace {

// Threads take chunks from a shared counter, so that uneven work (rays) balances itself.
void run_on_std_threads(int64_t n, int64_t grain, RangeBody body, void* context) {
  const int64_t n_threads = std::max<int64_t>(1, std::thread::hardware_concurrency());
  std::atomic<int64_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  auto work = [&] {
    for (int64_t begin; (begin = next.fetch_add(grain)) < n;) {
      try {
        body(begin, std::min(n, begin + grain), context);
      } catch (...) {
        std::lock_guard<std::mutex> lock(failure_mutex);
        if (!failure) failure = std::current_exception();
        next.store(n);
      }
    }
  };
  std::vector<std::thread> threads;
  const int64_t n_chunks = (n + grain - 1) / grain;
  for (int64_t t = 1; t < std::min(n_threads, n_chunks); ++t) threads.emplace_back(work);
  work();
  for (auto& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
}

std::atomic<ParallelBackend> backend{run_on_std_threads};

}  // namespace

void set_parallel_backend(ParallelBackend replacement) { backend = replacement ? replacement : run_on_std_threads; }

void parallel_ranges(int64_t n, int64_t grain, RangeBody body, void* context) {
  if (n <= 0) return;
  grain = std::max<int64_t>(1, grain);
  if (n <= grain) return body(0, n, context);
  backend.load()(n, grain, body, context);
}

}  // namespace splitnerf
