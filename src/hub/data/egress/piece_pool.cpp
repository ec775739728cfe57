#include "hub/data/egress/piece_pool.hpp"

#include <utility>

namespace gimnet::hub {

void ReturnPieces::operator()(MorePieces* first) const {
  // One after the other: a message may have more pieces than the stack has room for calls.
  while (first != nullptr) {
    MorePieces& piece = *first;
    first = piece.next.release();
    piece.pool->give_back(piece);
  }
}

PiecePool::~PiecePool() {
  while (free_ != nullptr) delete std::exchange(free_, free_->next.release());
}

PieceRef PiecePool::take(Run run) {
  MorePieces* piece = free_;
  if (piece != nullptr) {
    free_ = piece->next.release();
    --kept_;
  } else {
    piece = new MorePieces;
    piece->pool = this;
  }
  piece->run = std::move(run);
  budget_.take(sizeof(MorePieces));
  return PieceRef(piece);
}

void PiecePool::give_back(MorePieces& piece) {
  budget_.give_back(sizeof(MorePieces));
  piece.run = Run{};
  if (kept_ == kKeptMax) {
    delete &piece;
    return;
  }
  piece.next.reset(free_);
  free_ = &piece;
  ++kept_;
}

}  // namespace gimnet::hub
