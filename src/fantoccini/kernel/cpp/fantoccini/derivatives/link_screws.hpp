// The screws that move a link.
#pragma once

namespace fan {

// Calls `f` with the index of each: those of dynamic coordinates, then those of driven ones.
template <class Model, class F>
void each_screw(int link, const F& f) {
  for (int j = Model::moved_D_begin[link]; j < Model::moved_D_begin[link + 1]; ++j)
    f(Model::moved_D_entry[j]);
  for (int j = Model::moved_K_begin[link]; j < Model::moved_K_begin[link + 1]; ++j)
    f(Model::n_vD + Model::moved_K_entry[j]);
}

}  // namespace fan
