#include "resonarm.h"

resonarm_hello resonarm_own_hello(resonarm_profile profile, uint16_t rate_hz)
{
    const resonarm_hello hello = {
        .version_major = RESONARM_PROTOCOL_VERSION >> 4,
        .version_minor = RESONARM_PROTOCOL_VERSION & 0xFu,
        .dbc_hash = profile == RESONARM_PROFILE_FD ? RESONARM_DBC_HASH_FD : RESONARM_DBC_HASH_CLASSIC,
        .profile = profile,
        .rate_hz = rate_hz,
    };
    return hello;
}

resonarm_mismatch resonarm_compare_hellos(const resonarm_hello *own, const resonarm_hello *partner)
{
    if (own->version_major != partner->version_major) {
        return RESONARM_OTHER_VERSION;
    }
    if (own->profile != partner->profile) {
        return RESONARM_OTHER_PROFILE;
    }
    if (own->dbc_hash != partner->dbc_hash) {
        return RESONARM_OTHER_DBC;
    }
    return own->rate_hz == partner->rate_hz ? RESONARM_FITS : RESONARM_OTHER_RATE;
}
