// Lets fatrop begin with given multipliers, for which CasADi's interface has no way.
//
// fatrop begins with multipliers of 1 for all bounds, and finds those of the equations by least
// squares. One function of its library does this. The function here has the same name and stands in
// for it (see multipliers.py): it calls fatrop's own, and then replaces the multipliers if any were
// given. Otherwise nothing differs.

#include <dlfcn.h>

#include <memory>
#include <vector>

#include "fatrop/ip_algorithm/ip_data.hpp"
#include "fatrop/ip_algorithm/ip_eq_mult_initializer.hpp"
#include "fatrop/ip_algorithm/ip_initializer.hpp"
#include "fatrop/ip_algorithm/ip_iterate.hpp"
#include "fatrop/linear_algebra/vector.hpp"
#include "fatrop/nlp/nlp.hpp"
#include "fatrop/ocp/hessian.hpp"
#include "fatrop/ocp/jacobian.hpp"
#include "fatrop/ocp/problem_info.hpp"
#include "fatrop/ocp/type.hpp"

namespace
{
    constexpr const char *name = "_ZN6fatrop13IpInitializerINS_7OcpTypeEE10initializeEv";
    typedef void (*Initialize)(void *initializer);
    std::vector<double> given;                             // equations, lower bounds, upper bounds
    std::weak_ptr<fatrop::IpData<fatrop::OcpType>> last;   // of the solve that was begun last
}

namespace fatrop
{
    template <> void IpInitializer<OcpType>::initialize()
    {
        static const Initialize own = reinterpret_cast<Initialize>(dlsym(RTLD_NEXT, name));
        own(this);
        last = ipdata_;
        auto &iterate = ipdata_->current_iterate();
        const Index bounds = iterate.primal_s().m(), rows = iterate.dual_eq().m();
        if (static_cast<std::size_t>(rows + 2 * bounds) != given.size())
            return;
        VecRealAllocated equations(rows), lower(bounds), upper(bounds);
        for (Index i = 0; i < rows; ++i)
            equations(i) = given[i];
        for (Index i = 0; i < bounds; ++i)
        {
            lower(i) = given[rows + i];
            upper(i) = given[rows + bounds + i];
        }
        iterate.set_dual_eq(equations);
        iterate.set_dual_bounds_l(lower); // zero where there is no bound
        iterate.set_dual_bounds_u(upper);
    }
}

extern "C"
{
    // What the next solves begin with if they have as many multipliers; a count of 0: none.
    void aloft_give_multipliers(const double *values, int count)
    {
        given.assign(values, values + count);
    }

    // How many multipliers the last solve ended with, 0 if its solver is gone; they are written if
    // there is room for them.
    int aloft_take_multipliers(double *values, int room)
    {
        const auto data = last.lock();
        if (!data)
            return 0;
        const auto &iterate = data->current_iterate();
        const int bounds = iterate.primal_s().m(), rows = iterate.dual_eq().m();
        if (room < rows + 2 * bounds)
            return rows + 2 * bounds;
        for (int i = 0; i < rows; ++i)
            values[i] = iterate.dual_eq()(i);
        for (int i = 0; i < bounds; ++i)
        {
            values[rows + i] = iterate.dual_bounds_l()(i);
            values[rows + bounds + i] = iterate.dual_bounds_u()(i);
        }
        return rows + 2 * bounds;
    }
}
