/* J2 plasticity with linear hardening by radial return; PROPS: E, nu, yield stress, hardening modulus, and the
 * equivalent plastic strain at which the routine gives up (none if it is left out). STATEV: that strain. */
#include "umat.h"
#include <math.h>

UMAT(umat_)
{
    double e = props[0], nu = props[1], yield = props[2], h = props[3];
    double g = e / (2.0 * (1.0 + nu)), lambda = 2.0 * g * nu / (1.0 - 2.0 * nu);
    double trace = dstran[0] + dstran[1] + dstran[2];
    for (int i = 0; i < 6; i++)
        stress[i] += i < 3 ? lambda * trace + 2.0 * g * dstran[i] : g * dstran[i];
    double mean, mises;
    sinv_(stress, &mean, &mises, ndi, nshr);
    double over = mises - yield - h * statev[0], left = 1.0, along = 0.0, direction[6];
    for (int i = 0; i < 6; i++)
        direction[i] = mises > 0.0 ? (stress[i] - (i < 3 ? mean : 0.0)) / (mises * sqrt(2.0 / 3.0)) : 0.0;
    if (over > 0.0) {
        double flow = over / (3.0 * g + h);
        left = 1.0 - 3.0 * g * flow / mises;
        along = 2.0 * g * (left - h / (3.0 * g + h));
        statev[0] += flow;
        for (int i = 0; i < 6; i++)
            stress[i] = i < 3 ? (stress[i] - mean) * left + mean : stress[i] * left;
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double bulk = i < 3 && j < 3 ? lambda + 2.0 * g / 3.0 * (1.0 - left) : 0.0;
            double shear = i == j ? (i < 3 ? 2.0 * g : g) * left : 0.0;
            ddsdde[6 * j + i] = bulk + shear - along * direction[i] * direction[j];
        }
    if (*nprops > 4 && statev[0] > props[4])
        xit_();
}
