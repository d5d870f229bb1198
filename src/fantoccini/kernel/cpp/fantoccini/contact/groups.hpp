// Groups of bodies that influence one another: those of one tree, trees that strings connect, and,
// in a step, those that touch. The impulses of each group are a separate problem.
#pragma once

#include "fantoccini/math/real.hpp"

namespace fan {

template <class Model>
class ContactGroups {
 public:
  int n = 0;  // groups in which something takes part

  // Starts a step: contacts have not joined groups yet.
  FAN_FN void begin() {
    if (!known_) number_trees();
    for (int k = 0; k < n_trees_; ++k) {
      group_[k] = k;
      is_used_[k] = false;
    }
  }

  // Merges the groups of two links that touch; -1 for the world. Returns the tree.
  FAN_FN int joined(int a, int b) {
    const int x = tree_of(a), y = tree_of(b);
    if (x >= 0 && y >= 0) join(group_, n_trees_, group_[x], group_[y]);
    return use(x >= 0 ? x : y);
  }

  // The tree of a string or limit.
  FAN_FN int of_row(int r) { return use(row_[r]); }

  // Numbers the groups in which something takes part.
  FAN_FN void count() {
    n = 0;
    int number[N];
    for (int k = 0; k < n_trees_; ++k) number[k] = -1;
    for (int k = 0; k < n_trees_; ++k) {
      if (!is_used_[k]) continue;
      int& of = number[group_[k]];
      if (of < 0) of = n++;
      number_[k] = of;
    }
  }

  FAN_FN int trees() const { return n_trees_; }

  // The first tree of the current group of a tree.
  FAN_FN int named(int tree) const { return group_[tree]; }

  // The number of the group of a tree.
  FAN_FN int at(int tree) const { return number_[tree]; }

 private:
  static constexpr int N = array_size(Model::n_vD), S = Model::n_strings, M = Model::n_rows;
  static constexpr int L = Model::n_links;

  // Numbers the trees, each a group of velocities. Rows without velocities may belong to any.
  FAN_FN void number_trees() {
    known_ = true;
    for (int k = 0; k < N; ++k) tree_[k] = k;
    const auto connect = [&](const int* begin, const int* entry) {
      for (int j = begin[0]; j < begin[1]; ++j)
        join(tree_, N, tree_[entry[begin[0]]], tree_[entry[j]]);
    };
    for (int i = 0; i < L; ++i) connect(Model::moved_D_begin + i, Model::moved_D_entry);
    for (int r = 0; r < S; ++r) connect(Model::string_begin + r, Model::string_entry);
    // The first velocity of a tree, its name so far, comes first.
    for (int k = 0; k < N; ++k) tree_[k] = tree_[k] == k ? n_trees_++ : tree_[tree_[k]];
    for (int i = 0; i < L; ++i) {
      const int* begin = Model::moved_D_begin + i;
      link_[i] = begin[0] < begin[1] ? tree_[Model::moved_D_entry[begin[0]]] : -1;
    }
    for (int r = 0; r < M; ++r) {
      const int first = r < S ? Model::string_begin[r] : 0;
      if (r >= S) row_[r] = tree_[Model::limit_v[r - S]];
      else row_[r] = first < Model::string_begin[r + 1] ? tree_[Model::string_entry[first]] : 0;
    }
  }

  // Merges groups x and y under the smaller name.
  FAN_FN static void join(int* group, int n, int x, int y) {
    const int from = x > y ? x : y, to = x > y ? y : x;
    for (int k = 0; k < n && from != to; ++k)
      if (group[k] == from) group[k] = to;
  }

  FAN_FN int tree_of(int link) const { return link < 0 ? -1 : link_[link]; }

  FAN_FN int use(int tree) {
    const int known = tree < 0 ? 0 : tree;
    is_used_[known] = true;
    return known;
  }

  bool known_ = false;
  int n_trees_ = 0;
  int tree_[N], link_[array_size(L)],
      row_[array_size(M)];    // tree of every velocity, link, string and limit
  int group_[N], number_[N];  // of every tree
  bool is_used_[N];
};

}  // namespace fan
