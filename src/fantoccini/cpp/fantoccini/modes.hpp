// What rows do between two events, and how nearly rows may depend on one another there.
#pragma once

namespace fan {

constexpr int kRefinements = 2;  // of the held rows' tensions

// |hddot| at which a row that held with others no longer does, relative to the size of its terms.
constexpr double kApart = 1e-8;

// Pivot of G, relative to its largest diagonal, below which a row hardly stands on its own.
constexpr double kFrail = 1e-4;

// Raise of G where lengths and speeds are corrected, relative to its largest diagonal.
constexpr double kSoft = 1e-10;

}  // namespace fan
