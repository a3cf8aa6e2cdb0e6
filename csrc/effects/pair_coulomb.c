/* Forces of the charged grains on each other: field/charges.h has the law and the methods. */
#include "../base/status.h"
#include "../base/vec3.h"
#include "../field/charges.h"
#include "laws.h"

#include <math.h>

enum { METHOD, CUTOFF, OPENING, IMAGES };

/* At the edge of a stream whose grains all carry the charge of contact or of saturation, of one sign: the field of a charged
 * sheet, Q n/(2 eps0) of n grains per area, on Q. One neighbour at the mean spacing n^(-1/2) pushes 2 pi times less. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    const ces_MaterialDef *material = &scale->material;
    const double k = material->permittivity / (material->permittivity + 2.0);
    const double charge = material->kind == CES_CONDUCTOR ? CES_SPHERE_K_Q : 3.0 * k; /* over 4 pi eps0 r^2 E */
    return scale->coverage > 0.0 ? 6.0 * charge * charge * scale->coverage * ces_field_over_weight(scale) : 0.0;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    if (parameters[METHOD] != floor(parameters[METHOD])) {
        return ces_fail(error, CES_INPUT, "pair_coulomb.method is %g, must be 0, 1 or 2", parameters[METHOD]);
    }
    ces_ChargesDef *charges = state;
    *charges = (ces_ChargesDef){
        .method = (ces_ChargeMethod)parameters[METHOD],
        .cutoff = parameters[CUTOFF],
        .opening = parameters[OPENING],
        .drum_axis = {def->drum_axis[0], def->drum_axis[1]},
        .drum_radius = parameters[IMAGES] > 0.0 ? def->drum_radius : 0.0,
        .seed = def->seed,
    };
    ces_multipole_table(&charges->table);
    return CES_OK;
}

static bool prepare(const void *state, const ces_Crowd *crowd, ces_Pool *pools, double *force, ces_CrowdError *error)
{
    return ces_charges_force(state, crowd, pools, force, error);
}

/* clang-format off */
const ces_Effect ces_pair_coulomb = {
    .name = "pair_coulomb",
    .doc = "forces of the charged grains on each other, and of their images in the drum",
    .source = "Coulomb; method of images; Dehnen, J. Comput. Phys. 179 (2002) 27",
    .parameters = {
        {"method", "1", CES_CHARGES_TREE, 0.0, CES_CHARGE_METHOD_COUNT - 1, "0: all pairs by a tree; 1: pairs up to the cut-off; 2: all pairs one by one"},
        {"cutoff", "m", 0.02, 1e-9, 1e6, "method 1: the distance up to which two grains feel each other"},
        {"opening", "1", 0.7, 0.05, 0.9, "method 0: two cells whose radii are less than this part of their distance act as wholes"},
        {"images", "1", 1.0, 0.0, 1.0, "1: the grounded drum screens its grains from each other; 0: it does not"},
    },
    .size_formula = "6 q^2 C eps0 E^2/(r rho g), C the coverage; q = pi^2/6 of a conductor, 3 eps_r/(eps_r + 2) of an insulator",
    .size = size,
    .state_size = sizeof(ces_ChargesDef),
    .start = start,
    .prepare = prepare,
};
/* clang-format on */
